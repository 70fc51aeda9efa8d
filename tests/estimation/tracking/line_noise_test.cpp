#include "estimation/tracking/line_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <stdexcept>
#include <vector>

#include "tests/estimation/tracked_stage.hpp"

namespace stageid::test_line_noise {

constexpr Eigen::Index kOutputs = 2;
constexpr Eigen::Index kLines = 20;

/// Correlated noise of two outputs, on every other line larger by a factor.
class Noise {
 public:
  Noise(std::uint64_t seed, double larger) : random_(seed), larger_(larger) {}
  Eigen::MatrixXcd period() {
    Eigen::MatrixXcd e = test::circular_matrix(random_, kOutputs, kLines);
    for (Eigen::Index k = 0; k < kLines; ++k) e.col(k) = factor(k) * e.col(k);
    return e;
  }
  std::vector<Eigen::MatrixXcd> periods(int count) {
    std::vector<Eigen::MatrixXcd> out;
    for (int t = 0; t < count; ++t) out.push_back(period());
    return out;
  }
  /// L L^H is the covariance.
  Eigen::MatrixXcd factor(Eigen::Index k) const {
    const Eigen::MatrixXcd L{{1.0, 0.0}, {std::complex<double>(0.5, 0.6), 0.3}};
    return (k % 2 == 0 ? larger_ : 1.0) * L;
  }

 private:
  test::RandomNumbers random_;
  double larger_;
};

TEST(LineNoise, WhitensNoiseOfAKnownCovariance) {
  constexpr int kPeriods = 4000;
  Noise noise(1, 1.0);
  const LineNoise learned(noise.periods(kPeriods));
  for (Eigen::Index k = 0; k < kLines; ++k) {
    Eigen::MatrixXcd columns = Eigen::MatrixXcd::Zero(kOutputs * kLines, kOutputs);
    columns.middleRows(k * kOutputs, kOutputs) = noise.factor(k);
    const Eigen::MatrixXd white = learned.whitened(columns);
    Eigen::MatrixXcd of_line(kOutputs, kOutputs);
    of_line.real() = white.middleRows(2 * k * kOutputs, kOutputs);
    of_line.imag() = white.middleRows((2 * k + 1) * kOutputs, kOutputs);
    // Real and imaginary parts have variance one each. That of the periods deviates by 1 / sqrt(periods).
    const Eigen::MatrixXcd covariance = of_line * of_line.adjoint();
    EXPECT_LT(
        (covariance - 2.0 * Eigen::MatrixXcd::Identity(kOutputs, kOutputs)).cwiseAbs().maxCoeff(),
        2.0 * 4.5 / std::sqrt(kPeriods))
        << k;
    EXPECT_NEAR(white.squaredNorm(), of_line.squaredNorm(), 1e-12) << "of one line only";
  }
}

void expect_covariance_of_fresh_periods(double larger, double overstated) {
  constexpr int kRuns = 500;
  constexpr int kFresh = 20;
  constexpr Eigen::Index kSums = 3;
  test::RandomNumbers random(2);
  const Eigen::MatrixXcd derivatives = test::circular_matrix(random, kOutputs * kLines, kSums);
  Noise noise(3, larger);
  Eigen::MatrixXd stated = Eigen::MatrixXd::Zero(kSums, kSums);
  Eigen::MatrixXd found = stated;
  Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(kSums);
  Eigen::ArrayXd freedom = squares;
  for (int run = 0; run < kRuns; ++run) {
    const LineNoise learned(noise.periods(16));
    const Eigen::MatrixXd J = learned.whitened(derivatives);
    const SumCovariance K = learned.covariance(J);
    stated += K.value / kRuns;
    squares += K.value.diagonal().array().square() / kRuns;
    freedom += K.freedom.array() / kRuns;
    for (int t = 0; t < kFresh; ++t) {
      const Eigen::VectorXd sum = J.transpose() * learned.whitened(noise.period().reshaped());
      found += sum * sum.transpose() / (kRuns * kFresh);
    }
  }
  const Eigen::ArrayXd deviation = stated.diagonal().array().sqrt();
  const Eigen::MatrixXd difference =
      (found - stated).array() / (deviation.matrix() * deviation.matrix().transpose()).array();
  // 10 000 sums give 1.4 %. The weights without one of 16 periods differ from those with it: up to 2.5 %.
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 0.06) << difference;
  // The scatter of the stated variances has their degrees of freedom. That of the weights is not counted.
  const Eigen::ArrayXd mean = stated.diagonal().array();
  const Eigen::ArrayXd expected = 2.0 * mean.square() / (squares - mean.square());
  for (Eigen::Index i = 0; i < kSums; ++i) {
    EXPECT_GT(freedom[i], 0.8 * expected[i]) << i;
    EXPECT_LT(freedom[i], overstated * expected[i]) << i;
  }
}

TEST(LineNoise, TheCovarianceOfSumsIsThatOfFreshPeriods) {
  expect_covariance_of_fresh_periods(1.0, 1.6);
  expect_covariance_of_fresh_periods(30.0, 3.0);  // next to lines of much larger noise
}

TEST(LineNoise, ADriftWhileItIsLearnedIsNotNoise) {
  constexpr int kPeriods = 16;
  Noise noise(5, 1.0);
  const std::vector<Eigen::MatrixXcd> steady = noise.periods(kPeriods);
  std::vector<Eigen::MatrixXcd> drifting = steady;
  const Eigen::MatrixXcd change = noise.period();
  for (int t = 0; t < kPeriods; ++t) drifting[t] += (3.0 + static_cast<double>(t)) * change;
  const Eigen::MatrixXcd columns = noise.period().reshaped();
  const LineNoise a(steady);
  const LineNoise b(drifting);
  const Eigen::MatrixXd J = a.whitened(columns);
  EXPECT_LT((J - b.whitened(columns)).norm(), 1e-9 * J.norm());
  EXPECT_NEAR(b.covariance(J).value(0, 0), a.covariance(J).value(0, 0),
              1e-9 * a.covariance(J).value(0, 0));
}

TEST(LineNoise, TheRelativePowerOfFewPeriodsIsOneOnAverage) {
  constexpr int kRuns = 2000;
  Noise noise(4, 30.0);
  Eigen::VectorXd power = Eigen::VectorXd::Zero(kOutputs);
  Eigen::VectorXd doubled = power;
  for (int run = 0; run < kRuns; ++run) {
    const LineNoise learned(noise.periods(8));
    Eigen::MatrixXcd difference = noise.period() - noise.period();
    power += learned.relative_power(difference) / kRuns;
    difference.row(1) *= 2.0;
    doubled += learned.relative_power(difference) / kRuns;
  }
  // The relative deviation of a line is sqrt(1 + 1 / 5) from its own and that of 7 degrees of freedom, of all 40 000
  // lines 0.6 %.
  EXPECT_NEAR(power[0], 1.0, 0.025);
  EXPECT_NEAR(power[1], 1.0, 0.025);
  EXPECT_NEAR(doubled[0], power[0], 1e-12);
  EXPECT_NEAR(doubled[1], 4.0 * power[1], 1e-12);
}

TEST(LineNoise, NoiseFreeOutputsHaveFiniteWeights) {
  Noise noise(5, 1.0);
  std::vector<Eigen::MatrixXcd> residuals = noise.periods(8);
  for (Eigen::MatrixXcd& residual : residuals) residual.row(0).setZero();
  const LineNoise learned(residuals);
  EXPECT_TRUE(learned.whitened(noise.period().reshaped()).allFinite());
}

TEST(LineNoise, NeedsFourPeriods) {
  Noise noise(6, 1.0);
  EXPECT_THROW(LineNoise{noise.periods(3)}, std::invalid_argument);
  EXPECT_NO_THROW(LineNoise{noise.periods(4)});
}

}  // namespace stageid::test_line_noise
