#include "frf/health/data_health.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/logs/faulty_log.hpp"
#include "tests/support/logs/planted_faults.hpp"
#include "tests/support/stages/closed_loop.hpp"
#include "tests/support/stages/wafer_stage.hpp"
#include "tools/config/stage_expectation.hpp"
#include "tools/steps/health_step.hpp"

namespace stageid::test_health_step {

using test::MemoryLog;
using testing::AllOf;
using testing::Contains;
using testing::Not;

test::FaultyLogRequest request_of(std::uint64_t seed) {
  test::FaultyLogRequest request;
  request.configured = test::wafer_stage_spec();
  request.stage = test::random_wafer_stage(seed, request.configured);
  request.seed = seed;
  return request;
}

/// All findings that are not "not checked", one per line.
std::string told(const std::vector<Finding>& findings) {
  std::string text;
  for (const std::string& note : health_notes(findings)) text += note + "\n";
  return text;
}

/// Every kind of fault on one plant; 100 plants are in the study (docs/benchmarks.md).
TEST(DataHealth, EveryPlantedFaultIsNamedAndNothingElse) {
  const test::FaultyLogRequest request = request_of(3);
  const auto nominal = std::optional(nominal_stage(request.configured, request.configured.plant));
  const MemoryLog clean = test::simulate_faulty_log(request, {});
  ASSERT_FALSE(clean.log_runs.empty());
  for (const test::NamedFault& planted : test::faults_to_plant(3, clean)) {
    MemoryLog log = clean;
    if (planted.in_recording)
      test::spoil_recording(planted.fault, log);
    else
      log = test::simulate_faulty_log(request, planted.fault);
    if (log.log_runs.empty()) continue;  // the loop did not hold: nothing was measured
    FrfAndHealth both = estimate_plant_frf_and_health({&log});
    const auto findings = examine(both.frf, std::move(both.health), nominal);
    const test::Judgement judgement = test::judge(planted, findings, log.log_info);
    EXPECT_TRUE(judgement.named) << planted.name << " of " << planted.expected_channel << "\n"
                                 << told(findings);
    EXPECT_EQ(judgement.others, 0) << planted.name << "\n" << told(findings);
  }
}

// A cubic spring stiffens the suspension beyond the configured one. Above it, the mass is right.
TEST(DataHealth, AStifferSuspensionIsNoWrongScale) {
  test::FaultyLogRequest request = request_of(5);
  for (double& hz : request.stage.plant.suspension_hz) hz *= 4.0;
  const MemoryLog log = test::simulate_faulty_log(request, {});
  const auto findings = check_health(read_health_record({&log}, {}),
                                     nominal_stage(request.configured, request.configured.plant));
  EXPECT_TRUE(health_notes(findings).empty()) << told(findings);
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
  EXPECT_EQ(unchecked, 1);
  EXPECT_TRUE(std::ranges::any_of(
      findings, [](const Finding& f) { return f.cause == Cause::unknown_stage; }));
}

// The nearly constant record of another actuator would fit in its place, but its own would not fit in the other's.
TEST(DataHealth, AnActuatorThatMovesByItselfHasNotChangedPlacesWithOneThatStandsStill) {
  for (const std::uint64_t seed : {2002U, 2004U}) {
    const test::FaultyLogRequest request = request_of(seed);
    const auto nominal = std::optional(nominal_stage(request.configured, request.configured.plant));
    const MemoryLog clean = test::simulate_faulty_log(request, {});
    for (const test::NamedFault& planted : test::faults_to_plant(seed, clean)) {
      if (planted.fault.kind != test::PlantedFault::Kind::hidden_excitation) continue;
      const MemoryLog log = test::simulate_faulty_log(request, planted.fault);
      const auto findings = check_health(read_health_record({&log}, {}), nominal);
      const test::Judgement judgement = test::judge(planted, findings, log.log_info);
      EXPECT_TRUE(judgement.named && judgement.others == 0) << told(findings);
    }
  }
}

struct RecordingFault : ::testing::Test {
  std::vector<Finding> findings_of(const MemoryLog& log) const {
    return check_health(read_health_record({&log}, {}),
                        nominal_stage(request_.configured, request_.configured.plant));
  }
  /// The one finding in the recording with this fault.
  Finding only_finding(const test::PlantedFault& fault) const {
    MemoryLog log = log_;
    test::spoil_recording(fault, log);
    const std::vector<Finding> found = findings_of(log);
    EXPECT_EQ(health_notes(found).size(), 1U) << told(found);
    return found.empty() ? Finding() : found.front();
  }

  test::FaultyLogRequest request_ = request_of(6);
  MemoryLog log_ = test::simulate_faulty_log(request_, {});
};

// Three cyclically exchanged actuators must not be reported as a factor of 1e5 of all actuators.
TEST_F(RecordingFault, ThreeActuatorsInACircleAreNamedOneExchangeAfterTheOther) {
  using Kind = test::PlantedFault::Kind;
  test::spoil_recording({Kind::recorded_swap, false, 0, 1}, log_);
  test::spoil_recording({Kind::recorded_swap, false, 1, 2}, log_);
  const std::vector<Finding> found = findings_of(log_);
  ASSERT_EQ(health_notes(found).size(), 2U) << told(found);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(found[i].cause, Cause::swapped) << told(found);
}

TEST_F(RecordingFault, AnActuatorThatIsOneOrTwoSamplesLateIsSkewed) {
  for (const double samples : {1.0, -1.0, 2.0}) {
    SCOPED_TRACE(samples);
    const Finding found = only_finding({test::PlantedFault::Kind::recorded_skew, false, 4, 0,
                                        samples / log_.log_info.sample_rate_hz});
    EXPECT_EQ(found.cause, Cause::skew);
    EXPECT_EQ(found.channel, log_.log_info.actuators.names[4]);
  }
}

TEST_F(RecordingFault, AFactorOfThreePercentIsFound) {
  for (const bool of_sensor : {true, false}) {
    SCOPED_TRACE(of_sensor);
    EXPECT_EQ(only_finding({test::PlantedFault::Kind::recorded_gain, of_sensor, 2, 0, 1.03}).cause,
              Cause::scale);
  }
}

// In a twentieth of the samples it is constant for longer than a stuck sensor, repeatedly.
TEST_F(RecordingFault, ASensorThatIsClippedHardIsNotDead) {
  const Eigen::VectorXd samples = log_.records.front().sensors.col(1).cwiseAbs();
  std::vector<double> sorted(samples.begin(), samples.end());
  const auto limit =
      sorted.begin() + static_cast<std::ptrdiff_t>(0.9 * static_cast<double>(sorted.size()));
  std::nth_element(sorted.begin(), limit, sorted.end());
  test::spoil_recording({test::PlantedFault::Kind::saturation, true, 1, 0, *limit}, log_);
  const std::vector<Finding> found = findings_of(log_);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().cause, Cause::saturated) << told(found);
}

/// Three samples per period reach a limit. 25 samples at one end would be a finding by themselves; so few are one
/// because u = r - C y fails.
TEST(DataHealth, AFewClippedSamplesAreNotTakenForAnExcitationThatWasNotRecorded) {
  test::FaultyLogRequest request = request_of(40);
  request.seed = 1040;
  constexpr int kActuator = 7;
  const MemoryLog log = test::simulate_faulty_log(
      request, {test::PlantedFault::Kind::saturation, false, kActuator, 0, 7.3});
  const HealthRecord record = read_health_record({&log}, {});
  const ChannelScan& scan = record.scan[record.n_y() + kActuator];
  EXPECT_LE(scan.high().count, 10U);
  EXPECT_LE(scan.low().count, 10U);
  const auto findings =
      check_health(record, nominal_stage(request.configured, request.configured.plant));
  ASSERT_EQ(health_notes(findings).size(), 1U) << told(findings);
  EXPECT_EQ(findings.front().cause, Cause::saturated) << told(findings);
  EXPECT_EQ(findings.front().channel, "z8");
}

/// The loop moves the other ten: Y U^-1 of three is not the plant, so it cannot be used to check the wiring.
TEST(DataHealth, ActuatorsThatMoveUnexcitedAreNoFaultOfTheWiring) {
  test::FaultyLogRequest request = request_of(5);
  request.axes = 3;
  const MemoryLog log = test::simulate_faulty_log(request, {});
  const auto nominal = std::optional(nominal_stage(request.configured, request.configured.plant));
  const auto findings = check_health(read_health_record({&log}, {}), nominal);
  ASSERT_FALSE(findings.empty());
  for (const Finding& f : findings)
    EXPECT_TRUE(f.severity != Severity::fault || f.cause == Cause::excluded) << told(findings);
  EXPECT_EQ(findings.front().cause, Cause::excluded) << told(findings);
  EXPECT_EQ(findings.back().cause, Cause::rigid_body);
  EXPECT_EQ(findings.back().severity, Severity::unchecked);
}

// Forces move the stage slowly. The ends of a period differ, and with them the states of the controller.
TEST(DataHealth, AStageThatForcesMoveHasNoUnrecordedExcitation) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
    for (const int periods : {1, 2, 3}) {
      test::FaultyLogRequest request = request_of(seed);
      request.stage.simulation.force_noise_n = 0.3;
      request.axes = 2;
      request.period_s = 0.25;
      request.periods = periods;
      const MemoryLog log = test::simulate_faulty_log(request, {});
      const auto findings =
          check_health(read_health_record({&log}, {}),
                       nominal_stage(request.configured, request.configured.plant));
      EXPECT_TRUE(std::ranges::none_of(findings,
                                       [](const Finding& f) {
                                         return f.cause == Cause::unrecorded ||
                                                f.cause == Cause::controller;
                                       }))
          << seed << " " << periods << "\n"
          << told(findings);
    }
}

// Where the excitation of an axis does not arrive, the response is not determined, and what it leaves is not noise.
TEST(DataHealth, AMissingExcitationIsNoLimitCycle) {
  test::LoopExperiment x{.axes = 2, .realizations = 2, .periods = 3};
  x.noise_factor = 0.1 * Eigen::MatrixXcd::Identity(2, 2);
  MemoryLog log = test::simulate_log(test::small_stage(), x);
  const auto causes = [&log] {
    FrfEstimate frf;
    frf.experiment_noise_ratio = 200.0;
    std::vector<Cause> found;
    for (const Finding& f : examine(frf, read_health_record({&log}, {}), std::nullopt))
      found.push_back(f.cause);
    return found;
  };
  EXPECT_THAT(causes(), Contains(Cause::uneven_noise));
  for (Eigen::MatrixXd& period : log.excitation_periods)  // a third axis, recorded only
    period.col(2) = period.leftCols(2).rowwise().sum();
  EXPECT_THAT(causes(), AllOf(Contains(Cause::excitation), Not(Contains(Cause::uneven_noise)),
                              Not(Contains(Cause::limit_cycle))));
}

TEST(DataHealth, FindingsSurviveTheProvenance) {
  const std::vector<Finding> findings = {
      {Severity::fault, Cause::swapped, "a1 a2", "wired crosswise", "exchanged", "exchange them"},
      {Severity::unchecked, Cause::skew, "", "timing", "", "needs two periods"}};
  FrfEstimate frf;
  frf.provenance_json = "{\"version\": 1}";
  EXPECT_EQ(keep_health(frf, findings).size(), 2U);
  const std::vector<Finding> back = health_of(frf.provenance_json);
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(health_json(back), health_json(findings));
  EXPECT_TRUE(any_fault(back));
  EXPECT_TRUE(health_of("not JSON").empty());
  EXPECT_TRUE(health_of("{\"health\": 3}").empty());
}

}  // namespace stageid::test_health_step
