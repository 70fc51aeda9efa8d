#include "frf/response/covariance_smoothing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "frf/plant/plant_frf.hpp"
#include "frf/response/confidence.hpp"
#include "tests/support/models/numbered_frf.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_covariance_smoothing {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;

TEST(CovarianceSmoothing, IsTheMeanOfNeighboursAndTheWindowStaysInside) {
  const FrfEstimate frf = test::numbered_frf();
  const FrfEstimate smooth = smooth_covariance(frf, 3);
  const Eigen::MatrixXcd& C = frf.residual_covariance;
  const Eigen::MatrixXcd first = (C.col(0) + C.col(1) + C.col(2)) / 3.0;
  const Eigen::MatrixXcd last = (C.col(1) + C.col(2) + C.col(3)) / 3.0;
  EXPECT_TRUE(smooth.residual_covariance.col(0).isApprox(first, 1e-14));
  EXPECT_TRUE(smooth.residual_covariance.col(1).isApprox(first, 1e-14));
  EXPECT_TRUE(smooth.residual_covariance.col(3).isApprox(last, 1e-14));
  // Var G_ij = S_jj C_E,ii; covariance element of (i, j) and (h, l) = S_jl C_E,ih.
  const Eigen::MatrixXcd S = frf.input_factor.col(0).reshaped(3, 3);
  EXPECT_NEAR(smooth.noise_variance(1 + 2 * 2, 0), S(2, 2).real() * first(3, 0).real(), 1e-9);
  EXPECT_NEAR(std::abs(smooth.covariance(2 * 0 + 6 * (1 + 2 * 1), 0) - S(0, 1) * first(2, 0)), 0.0,
              1e-9);
  EXPECT_EQ(smooth.noise_dof, 3.0 * frf.noise_dof);
  EXPECT_EQ(smooth.covariance_lines, 3);
  EXPECT_EQ(smooth.total_variance, frf.total_variance);
  EXPECT_EQ(smooth.response, frf.response);
}

std::string message_of(const FrfEstimate& frf, int lines) {
  return test::error_message<std::invalid_argument>([&] { smooth_covariance(frf, lines); });
}

TEST(CovarianceSmoothing, RefusesWhatCannotBeSmoothed) {
  FrfEstimate frf = test::numbered_frf();
  EXPECT_THAT(message_of(frf, 2), HasSubstr("odd number"));
  EXPECT_THAT(message_of(frf, 0), HasSubstr("odd number"));
  EXPECT_THAT(message_of(frf, -3), HasSubstr("odd number"));
  EXPECT_THAT(message_of(frf, 5), HasSubstr("5 lines of 4"));
  EXPECT_THAT(message_of(smooth_covariance(frf, 3), 3), HasSubstr("mean of 3 lines"));
  frf.method = FrfMethod::lpm;
  EXPECT_THAT(message_of(frf, 3), HasSubstr("'lpm'"));
  frf = test::numbered_frf();
  frf.input_factor.resize(0, 0);
  EXPECT_THAT(message_of(frf, 3), HasSubstr("measure two periods"));
}

// Two periods and one realization: one degree of freedom per experiment and line, 19.0 in the quantile; seven lines
// together 7. The noise has the same spectrum on all lines, in closed loop.
TEST(CovarianceSmoothing, OverSeedsDegreesOfFreedomAreWhatTheySay) {
  LoopExperiment x{
      .lines = test::line_range(1, 41, 2), .axes = 1, .periods = 2, .transient_periods = 0};
  test::ClosedLoop loop{[](double) { return Eigen::MatrixXcd::Ones(2, 1); },
                        [](double) { return Eigen::MatrixXcd::Constant(1, 2, 0.4); }};
  x.noise_factor = 0.01 * Eigen::MatrixXcd::Identity(2, 2);
  constexpr int kSeeds = 400;
  double covered = 0.0;
  double mean = 0.0;
  Eigen::ArrayXXd sum, squares;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const MemoryLog log = test::simulate_log(loop, x);
    const FrfEstimate frf = estimate_plant_frf({&log}, {.covariance_lines = 7, .threads = 1});
    ASSERT_EQ(frf.noise_dof, 7.0);
    const Eigen::ArrayXXd error = (frf.response.array() - 1.0).abs();
    covered +=
        (error <= confidence_radius(frf, 0.95, VarianceKind::noise).array()).cast<double>().mean() /
        kSeeds;
    // U = 1 / (1 + 0.8), C_E = 1e-4 per period, two periods.
    const Eigen::ArrayXXd ratio = frf.noise_variance.array() / (1e-4 / 2.0 * 1.8 * 1.8);
    mean += ratio.mean() / kSeeds;
    if (seed == 1) sum = squares = Eigen::ArrayXXd::Zero(2, frf.lines());
    sum += ratio / kSeeds;
    squares += ratio.square() / kSeeds;
  }
  // 400 seeds x 2 outputs x some 3 independent windows: 0.45 % of a coverage; errors of the 21 lines
  // are independent.
  EXPECT_NEAR(covered, 0.95, 0.01);
  EXPECT_NEAR(mean, 1.0, 0.03);
  // A variance of 7 degrees of freedom has the relative variance 1 / 7.
  EXPECT_NEAR((squares - sum.square()).mean() * 7.0, 1.0, 0.15);
}

}  // namespace stageid::test_covariance_smoothing
