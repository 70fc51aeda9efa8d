// A stage that changed between two runs, against one that is nonlinear.
#include "frf/plant/line_alignment.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "frf/health/data_health.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/logs/told_findings.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid {
namespace test_line_alignment {

using test::MemoryLog;

struct Spec {
  std::uint64_t seed = 1;
  int realizations = 3;
  double cubic = 0.0;
  double change = 0.0;  ///< of the first mode's frequency
};

MemoryLog recorded(const Spec& spec) {
  test::LoopExperiment x{.sample_rate_hz = 2000.0, .period_samples = 1000, .axes = 2};
  x.lines = test::line_range(3, 301, 2);
  x.realizations = spec.realizations;
  x.periods = 4;
  x.transient_periods = 3;
  x.seed = spec.seed;
  test::ComplexNoise random(spec.seed + 100);
  const double first_hz = (60.0 + 60.0 * random.uniform()) * (1.0 + spec.change);
  return test::simulate_sampled_log(
      test::sampled_plant(3, 2, {{first_hz, 0.05}, {250.0, 0.04}}, x.sample_rate_hz, 0.02), x, 1e-5,
      spec.cubic);
}

/// The log of a stage whose first mode differs in one run.
MemoryLog changed(const Spec& spec, std::size_t run) {
  MemoryLog log = recorded({spec.seed, spec.realizations});
  log.records[run] = recorded(spec).records[run];
  return log;
}

std::vector<Finding> changes(const HealthRecord& record) {
  std::vector<Finding> found;
  for (const Finding& f : test::told(check_health(record, std::nullopt)))
    if (f.cause == Cause::drift) found.push_back(f);
  return found;
}

// Also of small changes: 0.1 % of a mode whose half-power width is 3 %.
TEST(PlantChange, OneChangedRunNamesItsRealization) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed)
    for (const double change : {0.001, 0.01, -0.03})
      for (const std::size_t run : {0U, 3U, 5U}) {
        const MemoryLog log = changed({seed, 3, 0.0, change}, run);
        const FrfAndHealth both = estimate_plant_frf_and_health({&log});
        const std::vector<Finding> found = changes(both.health);
        ASSERT_EQ(found.size(), 1U) << seed << " " << change << " " << run;
        EXPECT_EQ(found.front().severity, Severity::fault);
        EXPECT_EQ(found.front().realizations, std::vector<int>{static_cast<int>(run) / 2})
            << seed << " " << change << " " << run << " " << found.front().what;
      }
}

TEST(PlantChange, OfTwoRealizationsNoneIsNamed) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const MemoryLog log = changed({seed, 2, 0.0, 0.01}, 1);
    const HealthRecord record = estimate_plant_frf_and_health({&log}).health;
    found += changes(record).empty() ? 0 : 1;
    if (!record.differences.plant) continue;
    EXPECT_TRUE(
        to_finding(*record.differences.plant, record.differences.outlying, 2).realizations.empty());
  }
  EXPECT_EQ(found, 8);
}

TEST(PlantChange, NoiseAndDistortionAreNone) {
  for (std::uint64_t seed = 21; seed <= 40; ++seed)
    for (const int realizations : {2, 4})
      for (const double cubic : {0.0, 1e-3, 1e-1}) {
        const MemoryLog log = recorded({seed, realizations, cubic});
        const HealthRecord record = estimate_plant_frf_and_health({&log}).health;
        EXPECT_FALSE(record.differences.plant) << seed << " " << realizations << " " << cubic;
      }
}

}  // namespace test_line_alignment
}  // namespace stageid
