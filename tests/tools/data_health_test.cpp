#include "frf/data_health.hpp"

#include <gtest/gtest.h>

#include <optional>

#include "tests/support/faulty_log.hpp"
#include "tests/support/planted_faults.hpp"
#include "tests/support/wafer_stage.hpp"
#include "tools/health_step.hpp"
#include "tools/stage_expectation.hpp"

namespace stageid {
namespace {

using test::MemoryLog;

test::FaultyLogRequest request_of(std::uint64_t seed) {
  test::FaultyLogRequest request;
  request.configured = test::wafer_stage_spec();
  request.plant = test::random_wafer_stage(seed, request.configured);
  request.seed = seed;
  return request;
}

/// All findings that are not "not checked", one a line.
std::string told(const std::vector<Finding>& findings) {
  std::string text;
  for (const std::string& note : health_notes(findings)) text += note + "\n";
  return text;
}

/// Every kind of fault on one plant; 100 plants are in the study (docs/benchmarks.md).
TEST(DataHealth, EveryPlantedFaultIsNamedAndNothingElse) {
  const test::FaultyLogRequest request = request_of(3);
  const auto nominal = std::optional(nominal_stage(request.configured));
  const MemoryLog clean = test::simulate_faulty_log(request, {});
  ASSERT_FALSE(clean.log_runs.empty());
  for (const test::NamedFault& planted : test::faults_to_plant(3, clean)) {
    MemoryLog log = clean;
    if (planted.in_recording)
      test::spoil_recording(planted.fault, log);
    else
      log = test::simulate_faulty_log(request, planted.fault);
    if (log.log_runs.empty()) continue;  // the loop did not hold: nothing was measured
    const auto findings = check_health(read_health_record({&log}, {}), nominal);
    const test::Judgement judgement = test::judge(planted, findings, log.log_info);
    EXPECT_TRUE(judgement.named) << planted.name << " of " << planted.expected_channel << "\n"
                                 << told(findings);
    EXPECT_EQ(judgement.others, 0) << planted.name << "\n" << told(findings);
  }
}

TEST(DataHealth, WithoutAConfigurationTheWiringIsNotCheckedRatherThanFine) {
  test::FaultyLogRequest request = request_of(4);
  request.axes = 3;
  const MemoryLog log = test::simulate_faulty_log(request, {});
  const auto findings = check_health(read_health_record({&log}, {}), std::nullopt);
  int unchecked = 0;
  for (const Finding& finding : findings) {
    if (finding.severity != Severity::unchecked) continue;
    ++unchecked;
    EXPECT_NE(finding.remedy.find("--stage"), std::string::npos) << finding.remedy;
  }
  EXPECT_EQ(unchecked, 2);  // recording, and stage
}

TEST(DataHealth, FindingsSurviveTheProvenance) {
  const std::vector<Finding> findings = {
      {Severity::fault, Cause::swapped, "a1 a2", "wired crosswise", "exchanged", "exchange them"},
      {Severity::unchecked, Cause::skew, "", "timing", "", "needs two periods"}};
  const std::vector<Finding> back = health_of(with_health("{\"version\": 1}", findings));
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(health_json(back), health_json(findings));
  EXPECT_TRUE(any_fault(back));
  EXPECT_TRUE(health_of("not JSON").empty());
  EXPECT_TRUE(health_of("{\"health\": 3}").empty());
}

}  // namespace
}  // namespace stageid
