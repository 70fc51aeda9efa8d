// A stage that changed between two runs, against one that is nonlinear.
#include "frf/plant/line_alignment.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "frf/health/data_health.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/logs/told_findings.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_line_alignment {

using test::MemoryLog;
using test::record_realizations;

/// The log of a stage whose first mode differs in one run.
MemoryLog changed_in(std::size_t run, int realizations, std::uint64_t seed, double change) {
  MemoryLog log = record_realizations({realizations, seed, 1e-5});
  log.records[run] = record_realizations({realizations, seed, 1e-5, 0.0, change}).records[run];
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
        const MemoryLog log = changed_in(run, 3, seed, change);
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
    const MemoryLog log = changed_in(1, 2, seed, 0.01);
    const HealthRecord record = estimate_plant_frf_and_health({&log}).health;
    found += changes(record).empty() ? 0 : 1;
    if (!record.differences.plant) continue;
    EXPECT_TRUE(to_finding(*record.differences.plant).realizations.empty());
  }
  EXPECT_EQ(found, 8);
}

TEST(PlantChange, NoiseAndDistortionAreNone) {
  for (std::uint64_t seed = 21; seed <= 40; ++seed)
    for (const int realizations : {2, 4})
      for (const double cubic : {0.0, 1e-3, 1e-1}) {
        const MemoryLog log = record_realizations({realizations, seed, 1e-5, cubic});
        const HealthRecord record = estimate_plant_frf_and_health({&log}).health;
        EXPECT_FALSE(record.differences.plant) << seed << " " << realizations << " " << cubic;
      }
}

/// Differences of two realizations: noise, and on the lines from 5 to 44 of 200, which belong to several octaves, 100
/// times as much with neighbours that agree or not.
FrfEstimate differing(std::uint64_t seed, bool alike, Eigen::MatrixXd& cosine) {
  test::RandomNumbers random(seed);
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(200, 1.0, 200.0);
  frf.inputs.names = {"a1"};
  frf.outputs.names = {"s1"};
  frf.response = Eigen::MatrixXcd::Ones(1, 200);
  frf.noise_variance = Eigen::MatrixXd::Ones(1, 200);
  frf.total_variance.resize(1, 200);
  cosine.resize(1, 200);
  for (Eigen::Index k = 0; k < 200; ++k) {
    const bool differs = k >= 5 && k < 45;
    frf.total_variance(0, k) = (differs ? 1e4 : 1.0) * -std::log(random.uniform(1e-9, 1.0));
    cosine(0, k) = differs && alike ? 0.9 : std::cos(random.uniform(0.0, 6.283185307));
  }
  return frf;
}

TEST(PlantChange, OfAFewLinesAcrossOctavesIsFoundAndChanceIsNot) {
  int by_chance = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Eigen::MatrixXd cosine;
    const FrfEstimate changed = differing(seed, true, cosine);
    EXPECT_TRUE(find_plant_change(changed, cosine)) << seed;
    const FrfEstimate distorted = differing(seed, false, cosine);
    if (find_plant_change(distorted, cosine)) ++by_chance;
  }
  EXPECT_EQ(by_chance, 0);
}

}  // namespace stageid::test_line_alignment
