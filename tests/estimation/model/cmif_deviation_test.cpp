#include "estimation/model/cmif.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

namespace stageid::test_cmif_deviation {

/// A standard circular complex Gaussian, E|z|^2 = 1, by Box and Muller.
std::complex<double> gaussian(std::mt19937_64& engine) {
  const auto uniform = [&] { return (static_cast<double>(engine() >> 11) + 0.5) * 0x1p-53; };
  return std::polar(std::sqrt(-std::log(uniform())), 2.0 * std::numbers::pi * uniform());
}

/// Lines of random matrices with well separated singular values, and variances of 1e-6 of them.
FrfEstimate some_frf(std::mt19937_64& engine, int outputs, int inputs) {
  constexpr Eigen::Index kLines = 3;
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 1.0, 3.0);
  for (int i = 0; i < outputs; ++i) frf.outputs.names.push_back(fmt::format("y{}", i));
  for (int i = 0; i < inputs; ++i) frf.inputs.names.push_back(fmt::format("u{}", i));
  frf.outputs.units.assign(frf.outputs.names.size(), "m");
  frf.inputs.units.assign(frf.inputs.names.size(), "N");
  frf.response.resize(outputs * inputs, kLines);
  frf.response = frf.response.unaryExpr([&](auto) { return gaussian(engine); });
  frf.noise_variance = frf.response.cwiseAbs2() * 1e-6;
  return frf;
}

// 20 000 draws: the standard deviation of a sample standard deviation is 1 / sqrt(2 * 20 000) = 0.5 %
// of it; what first order leaves out is 1e-3 of that. Margin: 5 standard deviations.
void expect_the_scatter_of_draws(CmifKind kind, int outputs, int inputs) {
  constexpr int kDraws = 20'000;
  std::mt19937_64 engine(12);
  const FrfEstimate truth = some_frf(engine, outputs, inputs);
  const Eigen::MatrixXd predicted = cmif_deviation(truth, kind, truth.noise_variance);
  const Eigen::MatrixXd exact = cmif(truth, kind);
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(exact.rows(), exact.cols());
  FrfEstimate drawn = truth;
  for (int draw = 0; draw < kDraws; ++draw) {
    for (Eigen::Index i = 0; i < truth.response.size(); ++i)
      drawn.response(i) = truth.response(i) + std::sqrt(truth.noise_variance(i)) * gaussian(engine);
    squares += (cmif(drawn, kind) - exact).cwiseAbs2();
  }
  const Eigen::MatrixXd scatter = (squares / kDraws).cwiseSqrt();
  ASSERT_EQ(predicted.rows(), exact.rows());
  for (Eigen::Index i = 0; i < scatter.size(); ++i)
    EXPECT_NEAR(predicted(i) / scatter(i), 1.0, 0.025) << "entry " << i;
}

TEST(CmifDeviation, IsTheScatterOfDraws) {
  expect_the_scatter_of_draws(CmifKind::response, 2, 3);
  expect_the_scatter_of_draws(CmifKind::accelerance, 3, 2);
  expect_the_scatter_of_draws(CmifKind::whitened, 2, 2);
}

TEST(CmifDeviation, RefusesAVarianceOfAnotherShapeAndWhiteningWithoutOne) {
  std::mt19937_64 engine(1);
  FrfEstimate frf = some_frf(engine, 2, 3);
  EXPECT_THROW(cmif_deviation(frf, CmifKind::response, Eigen::MatrixXd::Ones(2, 3)),
               std::invalid_argument);
  const Eigen::MatrixXd variance = frf.noise_variance;
  frf.noise_variance.resize(0, 0);
  EXPECT_THROW(cmif_deviation(frf, CmifKind::whitened, variance), std::invalid_argument);
}

}  // namespace stageid::test_cmif_deviation
