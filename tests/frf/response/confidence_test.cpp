#include "frf/response/confidence.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_confidence {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;

FrfEstimate unit_variances(double noise_dof, double total_dof) {
  FrfEstimate frf;
  frf.noise_variance = Eigen::MatrixXd::Ones(1, 1);
  frf.total_variance = Eigen::MatrixXd::Constant(1, 1, 4.0);
  frf.noise_dof = noise_dof;
  frf.total_dof = total_dof;
  return frf;
}

// scipy.stats.f.ppf(0.95, 2, 2 nu) for nu = 1, 2, 4, 9.
TEST(ConfidenceRadius, SquareIsTheQuantileOfF) {
  const double reference[][2] = {
      {1.0, 19.0}, {2.0, 6.944271909999157}, {4.0, 4.458970107524511}, {9.0, 3.554557145661787}};
  for (const auto& [dof, quantile] : reference) {
    const FrfEstimate frf = unit_variances(dof, dof);
    EXPECT_NEAR(confidence_radius(frf, 0.95, VarianceKind::noise)(0, 0), std::sqrt(quantile), 1e-9);
    EXPECT_NEAR(confidence_radius(frf, 0.95, VarianceKind::total)(0, 0), 2.0 * std::sqrt(quantile),
                1e-9);
  }
  EXPECT_NEAR(confidence_radius(unit_variances(1e12, 1.0), 0.95, VarianceKind::noise)(0, 0),
              std::sqrt(-std::log(0.05)), 1e-9);
}

std::string message_of(const FrfEstimate& frf, double level, VarianceKind kind) {
  return test::error_message<std::invalid_argument>([&] { confidence_radius(frf, level, kind); });
}

TEST(ConfidenceRadius, RefusesWhatItCannotKnow) {
  const FrfEstimate frf = unit_variances(4.0, 0.0);
  for (const double level : {0.0, 1.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THAT(message_of(frf, level, VarianceKind::noise), HasSubstr("between 0 and 1"));
  }
  EXPECT_THAT(message_of(frf, 0.95, VarianceKind::total), HasSubstr("two realizations"));
  EXPECT_THAT(message_of(FrfEstimate(), 0.95, VarianceKind::noise), HasSubstr("two periods"));
}

struct Coverage {
  double noise = 0.0;
  double total = 0.0;
  double asymptotic = 0.0;  ///< of the radius for known variance
};

/// Open loop, one axis and experiment, so that the degrees of freedom are M (P - 1) and M - 1.
Coverage coverage(int realizations, int periods) {
  const test::ClosedLoop loop{[](double) { return Eigen::MatrixXcd::Ones(2, 1); },
                              [](double) { return Eigen::MatrixXcd::Zero(1, 2); }};
  LoopExperiment x{.period_samples = 100, .lines = {1, 3, 5, 7, 9, 13, 21, 35}, .axes = 1};
  x.realizations = realizations;
  x.periods = periods;
  x.transient_periods = 0;
  x.noise_factor = 0.01 * Eigen::MatrixXcd::Identity(2, 2);
  constexpr int kSeeds = 800;
  Coverage c;
  for (int seed = 0; seed < kSeeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed + 1);
    const MemoryLog log = test::simulate_log(loop, x);
    const FrfEstimate frf = estimate_plant_frf({&log}, {.threads = 1});
    const Eigen::ArrayXXd error = (frf.response.array() - 1.0).abs();
    const auto within = [&](const Eigen::MatrixXd& radius) {
      return (error <= radius.array()).cast<double>().mean() / kSeeds;
    };
    c.noise += within(confidence_radius(frf, 0.95, VarianceKind::noise));
    c.asymptotic += within((-std::log(0.05) * frf.noise_variance).cwiseSqrt());
    if (realizations > 1) c.total += within(confidence_radius(frf, 0.95, VarianceKind::total));
  }
  return c;
}

// 800 seeds x 8 lines x 2 outputs: standard deviation of a coverage of 95 % is 0.19 %.
TEST(ConfidenceRadius, OverSeedsItCoversWhatItSays) {
  for (const int periods : {3, 5, 10}) {
    EXPECT_NEAR(coverage(1, periods).noise, 0.95, 0.01) << periods << " periods";
  }
  for (const int realizations : {2, 5, 10}) {
    EXPECT_NEAR(coverage(realizations, 2).total, 0.95, 0.01) << realizations << " realizations";
  }
  EXPECT_LT(coverage(1, 3).asymptotic, 0.87);  // the error that the test detects
}

/// Two outputs in different units, two inputs, two lines.
FrfEstimate small_frf() {
  FrfEstimate frf;
  frf.frequency_hz.resize(2);
  frf.frequency_hz << 1.0, 2.0;
  frf.inputs = {{"u1", "u2"}, {"N", "N"}};
  frf.outputs = {{"y1", "y2"}, {"m", "rad"}};
  frf.response.resize(4, 2);  // y1u1, y2u1, y1u2, y2u2
  frf.response << 3.0, 1.0, 10.0, 1.0, std::complex<double>(0.0, 4.0), 0.0, 0.0, 1.0;
  frf.noise_variance.resize(4, 2);
  frf.noise_variance << 1.0, 0.5, 2.0, 1.0, 1.5, 0.5, 1.0, 1.0;
  return frf;
}

TEST(RelativeVariance, IsTheMeanOverLinesAndOutputs) {
  // Line 1: 2.5 / 25 and 3 / 100; line 2: 1 / 1 and 2 / 2.
  EXPECT_DOUBLE_EQ(mean_relative_variance(small_frf(), VarianceKind::noise),
                   ((0.1 + 0.03) / 2.0 + 1.0) / 2.0);
}

TEST(RelativeVariance, TheWorstOneIsTheLargerOfThoseThatAreKnown) {
  FrfEstimate frf = small_frf();
  const double noise = mean_relative_variance(frf, VarianceKind::noise);
  EXPECT_DOUBLE_EQ(worst_relative_variance(frf).value(), noise);
  frf.total_variance = 3.0 * frf.noise_variance;
  EXPECT_DOUBLE_EQ(worst_relative_variance(frf).value(), 3.0 * noise);
  frf.total_variance *= 0.1;
  EXPECT_DOUBLE_EQ(worst_relative_variance(frf).value(), noise);
  frf.noise_variance.resize(0, 0);
  frf.total_variance.resize(0, 0);
  EXPECT_FALSE(worst_relative_variance(frf));
}

TEST(RelativeVariance, DoesNotDependOnTheUnitOfAnOutput) {
  FrfEstimate frf = small_frf();
  const double before = mean_relative_variance(frf, VarianceKind::noise);
  for (const int row : {1, 3}) {
    frf.response.row(row) *= 1e6;
    frf.noise_variance.row(row) *= 1e12;
  }
  EXPECT_DOUBLE_EQ(mean_relative_variance(frf, VarianceKind::noise), before);
}

TEST(RelativeVariance, RefusesWhatHasNone) {
  FrfEstimate frf = small_frf();
  EXPECT_THROW(mean_relative_variance(frf, VarianceKind::total), std::invalid_argument);
  frf.response.row(0).setZero();
  frf.response.row(2).setZero();
  EXPECT_THROW(mean_relative_variance(frf, VarianceKind::noise), std::invalid_argument);
  frf.noise_variance.resize(0, 0);
  EXPECT_THROW(mean_relative_variance(frf, VarianceKind::noise), std::invalid_argument);
}

}  // namespace stageid::test_confidence
