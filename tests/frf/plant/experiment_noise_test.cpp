// Noise that differs between the experiments of a realization, against repeated experiments.
#include "frf/plant/experiment_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "frf/health/estimate_check.hpp"
#include "frf/plant/plant_frf.hpp"
#include "frf/response/covariance_smoothing.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_experiment_noise {

using test::AxisScheme;
using test::LoopExperiment;
using test::MemoryLog;

constexpr int kSeeds = 150;

/// 48 lines; correlated noise at the sensors, with ten times the power in the second experiment.
LoopExperiment uneven(AxisScheme scheme, int realizations, int periods) {
  LoopExperiment x{.realizations = realizations, .periods = periods, .scheme = scheme};
  x.lines = test::line_range(4, 51, 1);
  x.noise_factor.resize(2, 2);
  x.noise_factor << 0.01, 0.0, std::complex<double>(0.005, 0.006), 0.007;
  x.noise_scale = {1.0, std::sqrt(10.0), 1.0};
  return x;
}

FrfEstimate estimate(const LoopExperiment& x,
                     CovarianceKind covariance = CovarianceKind::diagonal) {
  const MemoryLog log = test::simulate_log(test::small_stage(), x);
  return estimate_plant_frf({&log}, {.covariance = covariance, .threads = 1});
}

struct Repeated {
  Eigen::MatrixXd squares;  ///< mean of |error|^2
  Eigen::MatrixXd stated;   ///< mean of the variance
  Eigen::MatrixXd spread;   ///< variance of the stated variance over its mean squared
  double dof = 0.0;         ///< mean
  int separate = 0;         ///< seeds in which the experiments were found to differ
  int nonlinear = 0;        ///< bands and entries below 0.001
  int verdicts = 0;
};

Repeated repeat(LoopExperiment x) {
  const test::ClosedLoop loop = test::small_stage();
  Repeated all;
  Eigen::MatrixXd stated_squares;
  for (int seed = 0; seed < kSeeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(4000 + seed);
    const FrfEstimate frf = estimate(x);
    Eigen::MatrixXd square(frf.response.rows(), frf.lines());
    for (Eigen::Index k = 0; k < frf.lines(); ++k)
      square.col(k) =
          (frf.response.col(k) - loop.plant(test::omega_of(x, k)).reshaped()).cwiseAbs2();
    if (seed == 0) {
      all.squares = all.stated = stated_squares =
          Eigen::MatrixXd::Zero(square.rows(), square.cols());
    }
    all.squares += square / kSeeds;
    all.stated += frf.noise_variance / kSeeds;
    stated_squares += frf.noise_variance.cwiseAbs2() / kSeeds;
    all.dof += frf.noise_dof / kSeeds;
    all.separate += frf.experiment_noise_ratio > 1.0 ? 1 : 0;
    all.nonlinear += static_cast<int>((frf.nonlinearity.p_value.array() < 1e-3).count());
    all.verdicts += static_cast<int>(frf.nonlinearity.p_value.size());
  }
  all.spread = stated_squares.cwiseQuotient(all.stated.cwiseAbs2()).array() - 1.0;
  return all;
}

class ExperimentNoiseOf : public testing::TestWithParam<AxisScheme> {};

TEST_P(ExperimentNoiseOf, WhereItDiffersTheVariancesAreThoseOfRepeatedExperiments) {
  const Repeated all = repeat(uneven(GetParam(), 2, 3));
  EXPECT_EQ(all.separate, kSeeds);
  for (Eigen::Index c = 0; c < all.stated.rows(); ++c)  // 48 x 150 errors per entry: 1.2 %
    EXPECT_NEAR(all.stated.row(c).cwiseQuotient(all.squares.row(c)).mean(), 1.0, 0.05) << c;
  // The degrees of freedom are those of the scatter of the variances, over entries and lines. With simultaneous axes,
  // the variances also differ because of the phases.
  if (GetParam() == AxisScheme::single_axis) {
    EXPECT_NEAR(all.dof * all.spread.mean(), 1.0, 0.15);
  }
  EXPECT_LT(all.dof, 11.0);  // pooling would give 12
  // A linear plant is called nonlinear at the stated rate.
  EXPECT_LT(all.nonlinear, 1 + 0.01 * all.verdicts);
}

TEST_P(ExperimentNoiseOf, WhereItAgreesTheExperimentsArePooled) {
  LoopExperiment x = uneven(GetParam(), 2, 3);
  x.noise_scale.clear();
  const Repeated all = repeat(x);
  EXPECT_EQ(all.separate, 0);
  EXPECT_NEAR(all.dof, 12.0, 1e-9);  // M E (P - 1)
  for (Eigen::Index c = 0; c < all.stated.rows(); ++c)
    EXPECT_NEAR(all.stated.row(c).cwiseQuotient(all.squares.row(c)).mean(), 1.0, 0.05) << c;
}

INSTANTIATE_TEST_SUITE_P(Schemes, ExperimentNoiseOf,
                         testing::Values(AxisScheme::single_axis, AxisScheme::orthogonal));

// With one axis per experiment, an entry has the noise of its axis's experiment: the common covariance times the share
// of that experiment.
TEST(ExperimentNoise, TheFactorsComeNearestToIt) {
  const LoopExperiment x = uneven(AxisScheme::single_axis, 4, 8);
  const FrfEstimate frf = estimate(x, CovarianceKind::full);
  EXPECT_NEAR(frf.experiment_noise_ratio, 10.0, 3.0);
  Eigen::MatrixXd of_factors(6, frf.lines());
  Eigen::MatrixXd diagonal(6, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    for (Eigen::Index c = 0; c < 6; ++c) {
      of_factors(c, k) =
          frf.input_factor(4 * (c / 2), k).real() * frf.residual_covariance(3 * (c % 2), k).real();
      diagonal(c, k) = frf.covariance(7 * c, k).real();
    }
  }
  EXPECT_LT((diagonal - frf.noise_variance).norm(), 1e-12 * diagonal.norm());
  const Eigen::VectorXd ratio = of_factors.cwiseQuotient(diagonal).rowwise().mean();
  for (Eigen::Index c = 0; c < 6; ++c) EXPECT_NEAR(ratio[c], 1.0, 0.1) << c;
}

// 1-based, as in the program.
TEST(ExperimentNoise, NamesTheRunsAndByHowMuch) {
  const MemoryLog log =
      test::simulate_log(test::small_stage(), uneven(AxisScheme::single_axis, 2, 6));
  const FrfAndHealth both = estimate_plant_frf_and_health({&log}, {.threads = 1});
  ASSERT_EQ(both.health.noisy_runs.size(), 2U);
  for (int m = 0; m < 2; ++m) {
    const NoisyRun& run = both.health.noisy_runs[static_cast<std::size_t>(m)];
    EXPECT_EQ(run.realization, m);
    EXPECT_EQ(run.experiment, 1);
    EXPECT_NEAR(run.ratio, 10.0, 4.0);
  }
  const std::vector<Finding> findings = check_experiment_noise(both.frf, both.health.noisy_runs);
  ASSERT_EQ(findings.size(), 1U);
  for (const char* name : {"realization 1, experiment 2", "realization 2, experiment 2"})
    EXPECT_NE(findings[0].figure.find(name), std::string::npos) << findings[0].figure;
}

// With two experiments per realization, only the other realizations show which of them is unusual.
TEST(ExperimentNoise, NamesTheNoisyOneOfTwoAndTheLogStaysLinear) {
  int nonlinear = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    LoopExperiment x{.axes = 2, .realizations = 3, .periods = 4, .seed = seed};
    x.lines = test::line_range(4, 99, 1);
    x.noise_factor = 0.001 * Eigen::MatrixXcd::Identity(2, 2);
    MemoryLog log = test::simulate_log(test::small_stage(), x);
    x.noise_factor *= 5.0;
    const MemoryLog noisy = test::simulate_log(test::small_stage(), x);
    log.records[2] = noisy.records[2];  // the first experiment of the second realization
    const FrfAndHealth both = estimate_plant_frf_and_health({&log}, {.threads = 1});
    ASSERT_EQ(both.health.noisy_runs.size(), 1U) << seed;
    EXPECT_EQ(both.health.noisy_runs[0].realization, 1);
    EXPECT_EQ(both.health.noisy_runs[0].experiment, 0);
    EXPECT_NEAR(std::log(both.health.noisy_runs[0].ratio), std::log(25.0), 0.5);
    nonlinear += both.frf.nonlinearity.nonlinear() ? 1 : 0;
  }
  EXPECT_LE(nonlinear, 1);
}

// Stationary noise far below the lines: different values at the start and end of a period leak into all of them.
TEST(ExperimentNoise, SlowNoiseIsTheSameInAllExperiments) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    LoopExperiment x{.axes = 2, .realizations = 2, .periods = 8, .seed = seed};
    x.lines = test::line_range(4, 99, 1);
    MemoryLog log = test::simulate_log(test::small_stage(), x);
    test::ComplexNoise random(seed);
    for (LogSamples& record : log.records)
      for (Eigen::Index c = 0; c < record.sensors.cols(); ++c) {
        double slow = 0.0;
        for (Eigen::Index n = -5000; n < record.sensors.rows(); ++n) {
          slow = 0.998 * slow + random.gaussian().real();
          if (n >= 0) record.sensors(n, c) += 1e-3 * slow;
        }
      }
    EXPECT_EQ(estimate_plant_frf({&log}).experiment_noise_ratio, 1.0) << seed;
  }
}

TEST(ExperimentNoise, IsToldAndNotSmoothed) {
  const FrfEstimate frf = estimate(uneven(AxisScheme::orthogonal, 2, 3));
  const std::vector<Finding> findings = check_experiment_noise(frf);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].cause, Cause::uneven_noise);
  EXPECT_EQ(findings[0].severity, Severity::doubt);
  EXPECT_THROW(smooth_covariance(frf, 5), std::invalid_argument);
  LoopExperiment even = uneven(AxisScheme::orthogonal, 2, 3);
  even.noise_scale.clear();
  EXPECT_TRUE(check_experiment_noise(estimate(even)).empty());
}

}  // namespace stageid::test_experiment_noise
