#include "excitation/multisine/dft.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <thread>
#include <vector>

#include "excitation/multisine/random_stream.hpp"

namespace stageid::test_dft {

constexpr double kEps = std::numeric_limits<double>::epsilon();

Eigen::VectorXd noise(int length, std::uint64_t seed) {
  UniformStream random(seed);
  Eigen::VectorXd x(length);
  for (double& value : x) value = 2.0 * random.next() - 1.0;
  return x;
}

Eigen::VectorXcd forward(RealDft& dft, const Eigen::VectorXd& x) {
  return Eigen::Map<const Eigen::VectorXcd>(dft.forward(x).data(), dft.half_size());
}

class RealDftOfLength : public testing::TestWithParam<int> {};

TEST_P(RealDftOfLength, IsTheDefinition) {
  const int n = GetParam();
  RealDft dft(n);
  const Eigen::VectorXd x = noise(n, 1);
  const Eigen::VectorXcd spectrum = forward(dft, x);
  ASSERT_EQ(dft.half_size(), n / 2 + 1);
  for (int l = 0; l < dft.half_size(); ++l) {
    std::complex<double> sum = 0.0;
    for (int i = 0; i < n; ++i) {
      const double turns = static_cast<double>(static_cast<long long>(l) * i % n) / n;
      sum += x[i] * std::polar(1.0, -2.0 * std::numbers::pi * turns);
    }
    // The plain sum of n terms of size up to 1 rounds by at most n eps of each.
    EXPECT_LT(std::abs(spectrum[l] - sum), 4.0 * n * kEps) << "line " << l;
  }
}

TEST_P(RealDftOfLength, InverseUndoesForwardUpToTheLength) {
  const int n = GetParam();
  RealDft dft(n);
  const Eigen::VectorXd x = noise(n, 2);
  const Eigen::VectorXcd spectrum = forward(dft, x);
  EXPECT_LT((dft.inverse(spectrum) / n - x).cwiseAbs().maxCoeff(), 32.0 * kEps);
}

INSTANTIATE_TEST_SUITE_P(EvenOddPrimeAndRound, RealDftOfLength,
                         testing::Values(2, 3, 4, 7, 64, 101, 400));

TEST(RealDft, GivesTheSameBitsInEveryObjectAndThread) {
  constexpr int kLength = 4000;
  const Eigen::VectorXd x = noise(kLength, 4);
  std::array<Eigen::VectorXcd, 4> results;
  {
    std::vector<std::jthread> threads;
    for (Eigen::VectorXcd& result : results) {
      threads.emplace_back([&result, &x] {
        RealDft dft(kLength);
        for (int i = 0; i < 5; ++i) result = forward(dft, x);
      });
    }
  }
  for (const Eigen::VectorXcd& result : results) EXPECT_EQ(result, results[0]);
}

TEST(RealDft, KeepsItsBuffersWhenMoved) {
  RealDft first(8);
  first.input()[0] = 1.0;
  for (std::size_t i = 1; i < 8; ++i) first.input()[i] = 0.0;
  RealDft second = std::move(first);
  for (const auto& value : second.forward()) EXPECT_EQ(value, 1.0);
  EXPECT_EQ(second.length(), 8);
}

TEST(RealDft, RefusesImpossibleSizes) {
  EXPECT_THROW(RealDft(1), std::invalid_argument);
  EXPECT_THROW(RealDft(0), std::invalid_argument);
  EXPECT_THROW(RealDft(-4), std::invalid_argument);
  RealDft dft(8);
  EXPECT_THROW(dft.inverse(Eigen::VectorXcd::Zero(4)), std::invalid_argument);
  EXPECT_THROW(dft.inverse(Eigen::VectorXcd::Zero(8)), std::invalid_argument);
}

}  // namespace stageid::test_dft
