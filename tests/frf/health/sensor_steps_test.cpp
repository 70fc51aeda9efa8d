#include "frf/health/sensor_steps.hpp"

#include <gmock/gmock.h>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_sensor_steps {

struct Examined {
  bool nonlinear;
  std::vector<Finding> findings;
};

Examined examined(const test::RealizationsSpec& spec) {
  const test::MemoryLog log = test::record_realizations(spec);
  const auto both = estimate_plant_frf_and_health({&log}, {});
  return {both.frf.nonlinearity.nonlinear(), check_sensor_steps(both.frf, both.health)};
}

TEST(SensorSteps, AreToldInsteadOfANonlinearPlant) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const Examined found = examined({.seed = seed, .noise = 1e-6, .step = 0.01});
    EXPECT_TRUE(found.nonlinear);
    ASSERT_FALSE(found.findings.empty());
    for (const Finding& finding : found.findings) {
      EXPECT_EQ(finding.cause, Cause::resolution);
      EXPECT_EQ(finding.severity, Severity::doubt);
      EXPECT_THAT(finding.figure, testing::StartsWith("steps of 0.01 "));
    }
  }
}

// The steps are there, but they are not the cause.
TEST(SensorSteps, DoNotExcuseANonlinearPlant) {
  int nonlinear = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    const Examined found = examined({.seed = seed, .noise = 1e-6, .cubic = 3e-5, .step = 1e-3});
    EXPECT_TRUE(found.findings.empty());
    nonlinear += found.nonlinear ? 1 : 0;
  }
  EXPECT_GE(nonlinear, 4);  // the others are not settled
}

// Noise above the steps makes their error random: the variances contain it.
TEST(SensorSteps, BelowTheNoiseAreNotTold) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
    EXPECT_TRUE(examined({.seed = seed, .noise = 0.01, .step = 0.01}).findings.empty());
}

}  // namespace stageid::test_sensor_steps
