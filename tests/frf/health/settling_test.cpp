// A linear plant in poor records is not called nonlinear: realizations of unequal noise keep the rate of false alarms,
// and transients and drifts are identified.
#include "frf/health/estimate_check.hpp"

#include <gtest/gtest.h>

#include <cstdint>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_settling {

using test::AxisScheme;
using test::LoopExperiment;
using test::MemoryLog;

constexpr double kSampleRateHz = 200.0;

LoopExperiment experiment(int axes, int realizations, int periods, std::uint64_t seed) {
  LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = 400, .axes = axes};
  x.lines = test::line_range(11, 101, 2);
  x.realizations = realizations;
  x.periods = periods;
  x.transient_periods = 2;
  x.seed = seed;
  return x;
}

test::SampledPlant stage(int channels, double decay_s, double gain) {
  return test::sampled_plant(channels, channels, {{12.3, decay_s}, {37.0, decay_s}}, kSampleRateHz,
                             gain);
}

double share_below(const Eigen::MatrixXd& p, double limit) {
  return static_cast<double>((p.array() < limit).count()) / static_cast<double>(p.size());
}

// Axes with independent phases: cond(R), and with it the noise of G, differs between realizations and lines.
TEST(Settling, RealizationsOfUnequalNoiseKeepTheRateOfFalseAlarms) {
  constexpr int kSeeds = 150;
  double nonlinear = 0.0;
  double unsettled = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    LoopExperiment x = experiment(2, 4, 2, static_cast<std::uint64_t>(seed));
    x.scheme = AxisScheme::random;
    const MemoryLog log = test::simulate_sampled_log(stage(2, 0.1, 0.5), x, 0.05);
    const NonlinearityTest test = estimate_plant_frf({&log}, {.threads = 1}).nonlinearity;
    nonlinear += share_below(test.p_value, kNonlinearBelow) / kSeeds;
    unsettled += share_below(test.settled_p_value, kUnsettledBelow) / kSeeds;
  }
  // 1800 verdicts, two inputs of one output with a common noise: a standard deviation of 0.3 %. With the unweighted
  // variances it would be above 10 %.
  EXPECT_NEAR(nonlinear, kNonlinearBelow, 0.01);
  // 450 bands; the bands of one log share a test: 0.6 %.
  EXPECT_LT(unsettled, kUnsettledBelow + 0.015);
}

/// A different straight line on each sensor of each run, from 0 to `end` times a normal number.
void add_drift(MemoryLog& log, double end) {
  test::ComplexNoise random(77);
  for (LogSamples& record : log.records) {
    const Eigen::Index rows = record.sensors.rows();
    for (Eigen::Index i = 0; i < record.sensors.cols(); ++i)
      record.sensors.col(i) +=
          Eigen::VectorXd::LinSpaced(rows, 0.0, end * test::real_gaussian(random));
  }
}

// A drift is the same in each period, so the scatter of the periods does not contain it.
TEST(Settling, ADriftIsNotCalledNonlinear) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    MemoryLog log = test::simulate_sampled_log(stage(1, 0.1, 0.5), experiment(1, 3, 3, seed), 0.05);
    EXPECT_TRUE(check_settling(estimate_plant_frf({&log})).empty()) << seed;
    add_drift(log, 20.0);
    const FrfEstimate frf = estimate_plant_frf({&log});
    EXPECT_FALSE(frf.nonlinearity.settled(0)) << seed;
    EXPECT_EQ(frf.nonlinearity.p_value(0, 0), 1.0) << seed;
    const std::vector<Finding> found = check_settling(frf);
    ASSERT_EQ(found.size(), 1u) << seed;
    EXPECT_EQ(found[0].severity, Severity::doubt);
    EXPECT_EQ(found[0].cause, Cause::unsettled);
  }
}

// Modes that ring for three periods, from rest.
TEST(Settling, ATransientIsNotCalledNonlinear) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    LoopExperiment x = experiment(2, 3, 4, seed);
    const test::SampledPlant plant = stage(2, 6.0, 0.02);
    const MemoryLog log = test::simulate_sampled_log(plant, x, 1e-3);
    const NonlinearityTest at_once =
        estimate_plant_frf({&log}, {.transient_periods = 0}).nonlinearity;
    EXPECT_LT(at_once.settled_p_value.minCoeff(), kUnsettledBelow) << seed;
    EXPECT_EQ(share_below(at_once.p_value, 1e-6), 0.0) << seed;
    EXPECT_EQ(share_below(at_once.odd.p_value, 1e-6), 0.0) << seed;
    EXPECT_EQ(share_below(at_once.even.p_value, 1e-6), 0.0) << seed;
  }
}

// Ten bands, each tested at 1 %, would cause a finding in one of ten settled logs.
TEST(Settling, TheFindingIsRarerThanTheBands) {
  FrfEstimate frf;
  NonlinearityTest& test = frf.nonlinearity;
  test.band_hz.resize(10, 2);
  test.band_hz << Eigen::VectorXd::LinSpaced(10, 1.0, 10.0),
      Eigen::VectorXd::LinSpaced(10, 1.5, 10.5);
  EXPECT_TRUE(check_settling(frf).empty());
  test.settled_p_value = Eigen::VectorXd::Ones(10);
  test.settled_p_value[3] = 0.005;
  EXPECT_FALSE(test.settled(3));
  EXPECT_TRUE(check_settling(frf).empty());
  test.settled_p_value[7] = 0.0005;
  const std::vector<Finding> found = check_settling(frf);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NE(found[0].figure.find("4 ... 4.5 Hz"), std::string::npos) << found[0].figure;
  EXPECT_NE(found[0].figure.find("8 ... 8.5 Hz"), std::string::npos) << found[0].figure;
  EXPECT_NE(found[0].remedy.find("longer periods"), std::string::npos) << found[0].remedy;
}

// Distortions have random phases: they are not taken for a drift.
TEST(Settling, ADistortedPlantIsSettled) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    LoopExperiment x = experiment(2, 3, 3, seed);
    x.transient_periods = 4;
    const MemoryLog log = test::simulate_sampled_log(stage(2, 0.1, 0.5), x, 1e-4, 1e-3);
    const NonlinearityTest test = estimate_plant_frf({&log}).nonlinearity;
    EXPECT_GT(test.settled_p_value.minCoeff(), 1e-3) << seed;
    EXPECT_LT(test.p_value.minCoeff(), 1e-6) << seed;
  }
}

TEST(Settling, DiscardedFirstPeriodsAreATransient) {
  FrfEstimate frf;
  frf.realizations = frf.experiments = 2;
  frf.dropped_periods = {{0, 0, 0, ""}, {0, 1, 0, ""}};
  EXPECT_TRUE(check_discarded_starts(frf).empty());
  frf.dropped_periods.push_back({1, 0, 0, ""});
  const std::vector<Finding> found = check_discarded_starts(frf);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].cause, Cause::unsettled);
  EXPECT_EQ(found[0].figure, "3 of 4 runs");
}

TEST(Settling, AFindingThatExplainsItWithdrawsTheLinearityTest) {
  FrfEstimate frf;
  frf.nonlinearity.band_hz.setOnes(1, 2);
  frf.nonlinearity.p_value.setZero(1, 1);
  withdraw_linearity_test(frf, {{Severity::fault, Cause::scale, "", "", "", ""}});
  EXPECT_TRUE(frf.nonlinearity.nonlinear());
  withdraw_linearity_test(frf, {{Severity::fault, Cause::scale, "", "", "", "", {2}}});
  EXPECT_FALSE(frf.nonlinearity.nonlinear());
  EXPECT_FALSE(frf.nonlinearity.settled(0));
  frf.nonlinearity = {};
  frf.nonlinearity.band_hz.setOnes(1, 2);
  frf.nonlinearity.p_value.setZero(1, 1);
  withdraw_linearity_test(frf, {{Severity::doubt, Cause::drift, "", "", "", ""}});
  EXPECT_FALSE(frf.nonlinearity.nonlinear());
}

}  // namespace stageid::test_settling
