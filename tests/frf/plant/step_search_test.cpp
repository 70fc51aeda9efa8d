#include "frf/plant/step_search.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "frf/plant/plant_frf.hpp"
#include "frf/runs/run_table.hpp"
#include "tests/support/models/estimate_trials.hpp"

namespace stageid::test_step_search {

using test::LoopExperiment;
using test::MemoryLog;
using test::SampledPlant;

SampledPlant linear_plant() {
  return test::sampled_plant(2, 2, {{12.3, 0.1}, {37.0, 0.1}}, 200.0, 0.5);
}

LoopExperiment experiment(std::uint64_t seed) {
  LoopExperiment x{.sample_rate_hz = 200.0, .period_samples = 1000, .axes = 2};
  x.lines = test::line_range(21, 301, 4);
  x.realizations = 3;
  x.periods = 3;
  x.transient_periods = 1;
  x.seed = seed;
  return x;
}

/// Rms of the largest command of the linear loop.
double command_rms() {
  const MemoryLog log = test::simulate_sampled_log(linear_plant(), experiment(1), 0.0);
  const Eigen::MatrixXd& u = log.records[0].actuators;
  return std::sqrt(u.colwise().squaredNorm().maxCoeff() / static_cast<double>(u.rows()));
}

/// The first actuator rounds to the nearest step, the second one cuts.
SampledPlant stepped_plant(double first, double second) {
  SampledPlant plant = linear_plant();
  plant.applied = [=](Eigen::Index i, double u) {
    return i == 0 ? first * std::round(u / first) : second * std::trunc(u / second);
  };
  return plant;
}

/// Steps and noise relative to the rms command.
MemoryLog stepped_log(double first, double second, std::uint64_t seed, double noise = 1e-4) {
  const double rms = command_rms();
  return test::simulate_sampled_log(stepped_plant(first * rms, second * rms), experiment(seed),
                                    noise * rms);
}

/// Mean of |G - truth|^2 / total variance.
double misfit(const FrfEstimate& frf, const SampledPlant& plant) {
  return test::error_over(frf.total_variance, frf, plant);
}

std::vector<ActuatorStep> steps_in(const MemoryLog& log) {
  const FrfEstimate frf = estimate_plant_frf({&log});
  return find_actuator_steps(choose_runs({&log}, {}).realizations, frf, {});
}

TEST(StepSearch, FindsStepAndRoundingOfEachActuator) {
  const double rms = command_rms();
  for (const auto& [first, second] : {std::pair{0.2, 0.2}, {0.1, 0.33}, {0.5, 0.07}}) {
    const MemoryLog log = stepped_log(first, second, 5);
    const std::vector<ActuatorStep> found = estimate_plant_frf_and_health({&log}).health.steps;
    SCOPED_TRACE(testing::Message() << first << ", " << second);
    ASSERT_EQ(found.size(), 2U);
    EXPECT_NEAR(found[0].step / rms, first, 2e-3 * first);
    EXPECT_NEAR(found[1].step / rms, second, 2e-3 * second);
    EXPECT_EQ(found[0].rounding, Rounding::nearest);
    EXPECT_EQ(found[1].rounding, Rounding::to_zero);
  }
}

// With commands of a few steps, the spectrum of one actuator has several peaks.
TEST(StepSearch, EqualConvertersAreFoundEqual) {
  const double rms = command_rms();
  int found = 0;
  for (const double step : {0.6, 0.9, 1.2})
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const std::vector<ActuatorStep> steps = steps_in(stepped_log(step, step, seed));
      for (const ActuatorStep& one : steps) {
        EXPECT_EQ(one.step, steps.front().step) << "seed " << seed;
        EXPECT_NEAR(one.step / rms, step, (step < 1.0 ? 0.01 : 0.05) * step) << "seed " << seed;
        ++found;
      }
    }
  EXPECT_GT(found, 30);
}

// Every command is rounded at once, so the errors of eleven others hide an actuator's own ones. Axes are excited one by
// one: all commands but one are only those of the controller.
TEST(StepSearch, TwelveEqualConvertersAreAllFound) {
  SampledPlant plant = test::sampled_plant(
      5, 12, {{7.1, 0.1}, {12.3, 0.1}, {23.0, 0.1}, {37.0, 0.1}, {61.0, 0.1}}, 200.0, 0.1);
  LoopExperiment x = experiment(11);
  x.axes = 12;
  const MemoryLog linear = test::simulate_sampled_log(plant, x, 0.0);
  const Eigen::MatrixXd& u = linear.records[0].actuators;
  const double step = 0.3 * std::sqrt(u.col(0).squaredNorm() / static_cast<double>(u.rows()));
  plant.applied = [step](Eigen::Index, double command) {
    return step * std::round(command / step);
  };
  const MemoryLog log = test::simulate_sampled_log(plant, x, 1e-4 * step);
  const std::vector<ActuatorStep> steps = estimate_plant_frf_and_health({&log}).health.steps;
  ASSERT_EQ(steps.size(), 12U);
  for (const ActuatorStep& one : steps) {
    EXPECT_NEAR(one.step / step, 1.0, 2e-3) << one.actuator;
    EXPECT_EQ(one.rounding, Rounding::nearest) << one.actuator;
  }
}

// The idle actuator of an experiment moves by less than a step: its command is recorded, its force is zero.
TEST(StepSearch, TheResponseIsThatOfThePlant) {
  double sum = 0.0;
  constexpr int kLogs = 10;
  for (int seed = 1; seed <= kLogs; ++seed) {
    const MemoryLog log = stepped_log(0.3, 0.3, static_cast<std::uint64_t>(seed));
    sum += misfit(estimate_plant_frf({&log}), linear_plant());
  }
  // 2 degrees of freedom: the expectation of F(2, 4) is 2.
  EXPECT_LT(sum / kLogs, 3.0);
}

/// Both amplifiers saturate, at these multiples of the rms command.
MemoryLog limited_log(double first, double second, std::uint64_t seed) {
  const double rms = command_rms();
  SampledPlant plant = linear_plant();
  plant.applied = [=](Eigen::Index i, double u) {
    const double limit = rms * (i == 0 ? first : second);
    return std::clamp(u, -limit, limit);
  };
  return test::simulate_sampled_log(plant, experiment(seed), 1e-3 * rms);
}

// From commands that are cut most of the time to those that are cut at their peaks.
TEST(StepSearch, FindsTheLimitsOfSaturatedActuators) {
  const double rms = command_rms();
  double sum = 0.0;
  for (const auto& [first, second] : {std::pair{0.7, 0.7}, {1.5, 1.5}, {2.5, 2.5}, {1.0, 1.8}})
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const MemoryLog log = limited_log(first, second, seed);
      const FrfAndHealth both = estimate_plant_frf_and_health({&log});
      const std::vector<ActuatorStep>& found = both.health.steps;
      SCOPED_TRACE(testing::Message() << first << ", " << second << ", seed " << seed);
      ASSERT_EQ(found.size(), 2U);
      for (const ActuatorStep& one : found) EXPECT_EQ(one.rounding, Rounding::limited);
      EXPECT_NEAR(found[0].step / rms, first, 0.01 * first);
      EXPECT_NEAR(found[1].step / rms, second, 0.01 * second);
      sum += misfit(both.frf, linear_plant());
    }
  EXPECT_LT(sum / 12.0, 3.0);  // see TheResponseIsThatOfThePlant
}

// A spring that stiffens and a limit make smooth functions of the command, but only a limit explains the scatter.
TEST(StepSearch, ANonlinearPlantHasNoLimits) {
  const double rms = command_rms();
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
    for (const double cubic : {1e-3, 1e-2, 1e-1}) {
      const MemoryLog log = test::simulate_sampled_log(linear_plant(), experiment(seed), 1e-3 * rms,
                                                       cubic / (rms * rms));
      EXPECT_TRUE(estimate_plant_frf_and_health({&log}).health.steps.empty()) << seed << cubic;
    }
}

TEST(StepSearch, FindsNothingWithoutSteps) {
  const double rms = command_rms();
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const double cubic = seed % 2 == 0 ? 1e-2 / (rms * rms) : 0.0;
    EXPECT_TRUE(
        steps_in(test::simulate_sampled_log(linear_plant(), experiment(seed), 1e-3 * rms, cubic))
            .empty())
        << seed;
  }
}

// The recorder has the same converter: the record is what is applied.
TEST(StepSearch, FindsNothingInARecordOfTheSteps) {
  const double rms = command_rms();
  MemoryLog log = stepped_log(0.2, 0.2, 3);
  for (LogSamples& record : log.records) {
    for (double& u : record.actuators.col(0)) u = 0.2 * rms * std::round(u / (0.2 * rms));
    for (double& u : record.actuators.col(1)) u = 0.2 * rms * std::trunc(u / (0.2 * rms));
  }
  EXPECT_TRUE(steps_in(log).empty());
}

// Lost samples and steps are both found, and the period with the gap is dropped.
TEST(StepSearch, LostSamplesAreStillFound) {
  MemoryLog log = stepped_log(0.2, 0.2, 7);
  LogSamples& record = log.records[1];
  const Eigen::Index rows = record.sensors.rows();
  for (Eigen::MatrixXd* samples : {&record.sensors, &record.actuators})
    samples->middleRows(2300, rows - 2301) = samples->bottomRows(rows - 2301).eval();
  const FrfAndHealth found = estimate_plant_frf_and_health({&log});
  EXPECT_EQ(found.health.slips.size(), 1U);
  EXPECT_EQ(found.health.steps.size(), 2U);
  ASSERT_EQ(found.frf.dropped_periods.size(), 1U);
  EXPECT_THAT(found.frf.dropped_periods[0].reason, testing::HasSubstr("lost"));
}

// Steps are undone in the records as they are, so a period of which samples were replaced is dropped then.
TEST(StepSearch, AGlitchCostsItsPeriod) {
  MemoryLog log = stepped_log(0.2, 0.2, 7);
  MemoryLog marked = log;
  marked.records[1].marked[2300] = 1;
  const FrfEstimate by_mark = estimate_plant_frf({&marked});
  log.records[1].sensors(2300, 0) += 1e3 * log.records[1].sensors.cwiseAbs().maxCoeff();
  const FrfAndHealth found = estimate_plant_frf_and_health({&log});
  EXPECT_EQ(found.health.steps.size(), 2U);
  ASSERT_EQ(found.frf.dropped_periods.size(), 1U);
  EXPECT_EQ(found.frf.dropped_periods[0].period, 1);
  EXPECT_TRUE(found.frf.replaced_samples.empty());
  EXPECT_LT((found.frf.response - by_mark.response).squaredNorm(),
            0.1 * by_mark.total_variance.sum());
}

TEST(StepSearch, NumberOfThreadsDoesNotMatterAndTheProvenanceTellsTheSteps) {
  const MemoryLog log = stepped_log(0.2, 0.3, 2, 1e-3);
  const FrfEstimate frf = estimate_plant_frf({&log}, {.threads = 1});
  EXPECT_EQ(frf.response, estimate_plant_frf({&log}, {.threads = 4}).response);
  EXPECT_THAT(frf.provenance_json, testing::AllOf(testing::HasSubstr("actuator_steps"),
                                                  testing::HasSubstr("rounded towards zero")));
}

// An interrupt comes as an exception of the progress function.
TEST(StepSearch, TheSearchTellsItsProgressAndCanBeInterrupted) {
  const MemoryLog log = test::simulate_sampled_log(linear_plant(), experiment(1), 1e-3);
  const FrfEstimate frf = estimate_plant_frf({&log});
  const std::vector<RealizationRuns> realizations = choose_runs({&log}, {}).realizations;
  FrfOptions options;
  double last = 0.0;
  options.progress = [&last](double done, double total) { last = done / total; };
  find_actuator_steps(realizations, frf, options);
  EXPECT_EQ(last, 1.0);
  options.progress = [](double, double) { throw std::runtime_error("interrupted"); };
  EXPECT_THROW(find_actuator_steps(realizations, frf, options), std::runtime_error);
}

}  // namespace stageid::test_step_search
