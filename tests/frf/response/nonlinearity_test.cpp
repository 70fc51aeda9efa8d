#include "frf/response/nonlinearity.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_nonlinearity {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;

FrfEstimate one_band(int lines, double total, double noise, double total_dof, double noise_dof) {
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(lines, 100.0, 150.0);
  frf.response = Eigen::MatrixXcd::Ones(1, lines);
  frf.total_variance = Eigen::MatrixXd::Constant(1, lines, total);
  frf.noise_variance = Eigen::MatrixXd::Constant(1, lines, noise);
  frf.total_dof = total_dof;
  frf.noise_dof = noise_dof;
  return frf;
}

// scipy: stats.chi2.sf(-2 K log(stats.f.sf(x, 2 a, 2 b)), 2 K).
TEST(Nonlinearity, IsTestedAsByScipyAndMeasuredOfOneRealization) {
  const auto p = [](int K, double x, int a, double b) {
    return nonlinearity_test(one_band(K, x, 1.0, a, b)).p_value(0, 0);
  };
  EXPECT_NEAR(p(1, 3.0, 1, 4.0), 0.10662224073302785, 1e-9);
  EXPECT_NEAR(p(1, 2.5, 4, 9.0), 0.050735410649804746, 1e-9);
  EXPECT_NEAR(p(10, 1.7, 3, 12.0), 0.014870413896499016, 1e-9);
  const FrfEstimate frf = one_band(10, 5.0, 1.0, 2.0, 4.0);
  EXPECT_NEAR(nonlinearity_test(frf).distortion(0, 0), std::sqrt(3.0 * 4.0), 1e-12);
  // Files of others often lack the degrees of freedom.
  EXPECT_FALSE(NonlinearityTest{}.nonlinear());
  EXPECT_FALSE(linearity_of(one_band(20, 1.0, 1.0, 0.0, 0.0)).nonlinear());
}

TEST(Nonlinearity, BandsAreOctavesOfEnoughLines) {
  FrfEstimate frf = one_band(40, 1.0, 1.0, 1.0, 1.0);
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(40, 1.0, 40.0);
  const NonlinearityTest test = nonlinearity_test(frf);
  // 1 ... 8 (too few below), 9 ... 17, and 18 ... 35, which includes the last five lines.
  ASSERT_EQ(test.band_hz.rows(), 3);
  EXPECT_EQ(test.band_hz(0, 1), 8.0);
  EXPECT_EQ(test.band_hz(1, 1), 17.0);
  EXPECT_EQ(test.band_hz(2, 1), 40.0);
}

std::string message_of(const FrfEstimate& frf) {
  return test::error_message<std::invalid_argument>([&] { nonlinearity_test(frf); });
}

TEST(Nonlinearity, RefusesWithoutBothVariances) {
  EXPECT_THAT(message_of(one_band(10, 1.0, 1.0, 1.0, 0.0)), HasSubstr("two periods"));
  EXPECT_THAT(message_of(one_band(10, 1.0, 1.0, 0.0, 1.0)), HasSubstr("two realizations"));
  EXPECT_THAT(message_of(one_band(10, 1.0, 1.0, 1.5, 1.0)), HasSubstr("two realizations"));
}

TEST(Nonlinearity, OnALinearPlantFalseAlarmsAreNominal) {
  LoopExperiment x{.realizations = 3, .periods = 3};
  x.noise_factor = 0.01 * Eigen::MatrixXcd::Identity(2, 2);
  constexpr int kSeeds = 600;
  int tests = 0;
  int at_5_percent = 0;
  int at_1_percent = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const MemoryLog log = test::simulate_log(test::small_stage(), x);
    const NonlinearityTest test = nonlinearity_test(estimate_plant_frf({&log}, {.threads = 1}));
    tests += static_cast<int>(test.p_value.size());
    at_5_percent += static_cast<int>((test.p_value.array() < 0.05).count());
    at_1_percent += static_cast<int>((test.p_value.array() < 0.01).count());
  }
  // 3600 tests: standard deviations 0.36 and 0.17 %; slightly more, because the inputs of one output share its noise
  // estimate.
  EXPECT_NEAR(at_5_percent / static_cast<double>(tests), 0.05, 0.016);
  EXPECT_NEAR(at_1_percent / static_cast<double>(tests), 0.01, 0.008);
}

// Without noise, F exceeds 1e16 at the largest distortion; this is strong evidence, not none.
TEST(Nonlinearity, WithoutNoiseEveryBandThatIsDistortedIsNonlinear) {
  const test::SampledPlant plant =
      test::sampled_plant(2, 2, {{12.3, 0.1}, {37.0, 0.1}}, 200.0, 0.5);
  LoopExperiment x{.sample_rate_hz = 200.0, .period_samples = 400, .axes = 2};
  x.lines = test::line_range(11, 161, 2);
  x.realizations = 3;
  x.periods = 3;
  x.transient_periods = 6;
  const MemoryLog linear = test::simulate_sampled_log(plant, x, 0.0);
  const NonlinearityTest none = estimate_plant_frf({&linear}).nonlinearity;
  EXPECT_GT(none.p_value.minCoeff(), kNonlinearBelow);
  EXPECT_GE(none.settled_p_value.minCoeff(), kUnsettledBelow);
  for (const double cubic : {1e-6, 1e-4, 1e-2}) {
    const MemoryLog log = test::simulate_sampled_log(plant, x, 0.0, cubic);
    const NonlinearityTest test = estimate_plant_frf({&log}).nonlinearity;
    EXPECT_LT(test.p_value.maxCoeff(), kNonlinearBelow) << cubic;
    EXPECT_GE(test.p_value.minCoeff(), 0.0) << cubic;
    EXPECT_TRUE(test.p_value.allFinite()) << cubic;
  }
}

}  // namespace stageid::test_nonlinearity
