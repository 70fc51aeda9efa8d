// Also of wrong or unknown mappings in logs of other programs.
#include "frf/health/data_health.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "frf/health/health_measures.hpp"
#include "frf/plant/plant_frf.hpp"
#include "frf/wiring/feedback_check.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_data_health {

using test::LoopExperiment;
using test::MemoryLog;
using testing::HasSubstr;
using testing::Not;

MemoryLog closed_loop_log(std::uint64_t seed = 1, double noise = 1e-3,
                          const test::ClosedLoop& loop = test::small_stage()) {
  LoopExperiment x{.periods = 3, .seed = seed};
  x.lines = test::line_range(1, 60, 2);
  x.noise_factor = noise * Eigen::MatrixXcd::Identity(2, 2);
  return test::simulate_log(loop, x);
}

/// The loop of test::small_stage().
NominalStage small_nominal() {
  NominalStage nominal;
  nominal.actuators = {"a1", "a2", "a3"};
  nominal.sensors = {"z1", "z2"};
  nominal.controller = [](double hz) {
    return Eigen::MatrixXcd(-test::small_stage().controller(2.0 * std::numbers::pi * hz));
  };
  return nominal;
}

/// Records the excitation instead of the plant input.
void map_excitation(MemoryLog& log, Eigen::Index actuator, double factor) {
  for (std::size_t e = 0; e < log.records.size(); ++e) {
    const Eigen::MatrixXd& period = log.excitation_periods[e];
    for (Eigen::Index n = 0; n < log.records[e].actuators.rows(); ++n)
      log.records[e].actuators(n, actuator) = factor * period(n % period.rows(), actuator);
  }
}

std::vector<Finding> health_of(const MemoryLog& log,
                               const std::optional<NominalStage>& nominal = std::nullopt) {
  return check_health(read_health_record({&log}, {}), nominal);
}

const Finding* first_with(const std::vector<Finding>& findings, Cause cause) {
  const auto at = std::ranges::find(findings, cause, &Finding::cause);
  return at == findings.end() ? nullptr : &*at;
}

/// Expects a finding of this cause. @param channel empty: any
void expect_finding(const std::vector<Finding>& findings, Cause cause, Severity severity,
                    const std::string& channel, const std::string& what) {
  const Finding* finding = first_with(findings, cause);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->severity, severity);
  if (!channel.empty()) {
    EXPECT_EQ(finding->channel, channel);
  }
  EXPECT_THAT(finding->what, HasSubstr(what));
}

TEST(MappedExcitation, IsNamedAndNotCalledDead) {
  for (const double factor : {1.0, -2.5}) {
    MemoryLog log = closed_loop_log();
    map_excitation(log, 0, factor);
    for (const auto& nominal : {std::optional<NominalStage>(), std::optional(small_nominal())}) {
      const std::vector<Finding> found = health_of(log, nominal);
      expect_finding(found, Cause::injection, Severity::fault, "a1", "equals the excitation a1");
      EXPECT_THAT(first_with(found, Cause::injection)->remedy,
                  HasSubstr("after the summation point"));
      EXPECT_EQ(first_with(found, Cause::dead), nullptr);
      EXPECT_EQ(std::ranges::count(found, Severity::fault, &Finding::severity), 1);
    }
  }
}

TEST(MappedExcitation, OfAllActuatorsIsCorrectOnlyInALoopKnownToBeOpen) {
  MemoryLog log = closed_loop_log();
  for (Eigen::Index a = 0; a < 3; ++a) map_excitation(log, a, 1.0);
  const std::vector<Finding> found = health_of(log);
  ASSERT_NE(first_with(found, Cause::injection), nullptr);
  EXPECT_EQ(first_with(found, Cause::injection)->severity, Severity::fault);
  EXPECT_THAT(first_with(found, Cause::injection)->remedy, HasSubstr("if the loop is open"));
  EXPECT_THAT(first_with(health_of(log, small_nominal()), Cause::injection)->remedy,
              Not(HasSubstr("if the loop is open")));
  NominalStage open = small_nominal();
  open.controller = [](double) { return Eigen::MatrixXcd::Zero(3, 2); };
  EXPECT_EQ(first_with(health_of(log, open), Cause::injection), nullptr);
}

/// A chirp in the first third of each period, an open loop, one axis per experiment.
/// @param arrives number of the two axes that are driven
MemoryLog chirp_log(int arrives) {
  const int axes = 2;
  LoopExperiment x{.sample_rate_hz = 1000.0, .period_samples = 1000, .axes = axes};
  const test::SampledPlant plant =
      test::sampled_plant(axes, axes, {{30.0, 0.05}, {70.0, 0.05}}, 1000.0, 0.0);
  MemoryLog log;
  log.log_info.sample_rate_hz = 1000.0;
  log.log_info.period_samples = 1000;
  log.log_info.transient_periods = 1;
  log.log_info.excitation = log.log_info.actuators = test::channels("a", axes, "N");
  log.log_info.sensors = test::channels("z", axes, "m");
  test::ComplexNoise random(3);
  x.periods = 3;
  for (int e = 0; e < axes; ++e) {
    Eigen::MatrixXd period = Eigen::MatrixXd::Zero(1000, axes);
    for (int n = 0; n < 333; ++n) {
      const double t = 1e-3 * n;
      period(n, e) = std::sin(2.0 * std::numbers::pi * (5.0 + 300.0 * t) * t);
    }
    const Eigen::MatrixXd driven = period * (e < arrives ? 1.0 : 0.0);
    log.append(0, e, period, test::simulate_sampled_run(plant, x, driven, 1e-4, random));
  }
  return log;
}

TEST(Chirp, FollowedByRestIsNotDead) {
  MemoryLog log = chirp_log(2);
  const std::vector<Finding> found = health_of(log);
  EXPECT_EQ(first_with(found, Cause::dead), nullptr) << first_with(found, Cause::dead)->channel;
  EXPECT_EQ(first_with(found, Cause::saturated), nullptr);
  EXPECT_EQ(first_with(found, Cause::excitation), nullptr);
  // A sensor that is stuck during the chirp is still detected.
  double stuck_at = 0.25;
  for (LogSamples& record : log.records)
    record.sensors.col(1).tail(2500).setConstant(stuck_at += 0.01);
  const std::vector<Finding> stuck = health_of(log);
  ASSERT_NE(first_with(stuck, Cause::dead), nullptr);
  EXPECT_EQ(first_with(stuck, Cause::dead)->channel, "z2");
}

TEST(CoarseConverter, AMotionWithinOneStepIsNotCalledDead) {
  MemoryLog log = chirp_log(2);
  // A twentieth of the rms motion in the first experiment, and more than the second one moves the sensor.
  const double step = 0.05 * std::sqrt(log.records[0].sensors.col(1).squaredNorm() /
                                       static_cast<double>(log.records[0].sensors.rows()));
  log.records[1].sensors.col(1) *= 0.0;
  for (LogSamples& record : log.records)
    record.sensors.col(1) = (record.sensors.col(1) / step).array().round() * step;
  const std::vector<Finding> found = health_of(log);
  EXPECT_EQ(first_with(found, Cause::dead), nullptr);
  ASSERT_NE(first_with(found, Cause::resolution), nullptr);
  EXPECT_EQ(first_with(found, Cause::resolution)->channel, "z2");
}

/// As computed by a controller from the sensors' noise.
void add_noise_to_actuators(MemoryLog& log, double rms) {
  test::RandomNumbers random(9);
  for (LogSamples& record : log.records)
    for (double& u : record.actuators.reshaped()) u += rms * random.normal();
}

TEST(SilentAxis, IsNamedThoughItsExcitationIsRecorded) {
  MemoryLog log = chirp_log(1);
  add_noise_to_actuators(log, 1e-4);
  const std::vector<Finding> found = health_of(log);
  expect_finding(found, Cause::excitation, Severity::fault, "a2", "does not reach the stage");
}

TEST(SilentStage, IsNoCaseOfDeadSensors) {
  MemoryLog log = chirp_log(0);  // the sensors measure noise, the actuators record the excitation
  for (Eigen::Index a = 0; a < 2; ++a) map_excitation(log, a, 1.0);
  add_noise_to_actuators(log, 0.1);
  const std::vector<Finding> found = health_of(log);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].cause, Cause::incoherent) << found[0].what << found[0].channel;
  EXPECT_EQ(found[0].severity, Severity::fault);
  EXPECT_EQ(first_with(found, Cause::dead), nullptr);
}

/// A slow motion that does not repeat with the period.
void move(MemoryLog& log, double first_m, double second_m) {
  for (LogSamples& record : log.records)
    for (Eigen::Index n = 0; n < record.sensors.rows(); ++n) {
      const double slow = std::sin(0.0021 * static_cast<double>(n) + 0.4);
      record.sensors(n, 0) += first_m * slow;
      record.sensors(n, 1) += second_m * slow;
    }
}

TEST(MovingSetpoint, IsNotADeadSensor) {
  MemoryLog log = closed_loop_log();
  EXPECT_LT(common_motion(read_health_record({&log}, {}), 0, 1), 0.3);  // independent noise
  move(log, 300.0, 1.0);
  EXPECT_GT(common_motion(read_health_record({&log}, {}), 0, 1), 0.6);
  NominalStage nominal = small_nominal();
  nominal.rigid_body = [](double) { return Eigen::MatrixXcd(Eigen::MatrixXcd::Ones(2, 3)); };
  const std::vector<Finding> found = health_of(log, nominal);
  EXPECT_EQ(first_with(found, Cause::dead), nullptr);
  expect_finding(found, Cause::incoherent, Severity::fault, "z1", "moving setpoint");
}

// A factor would explain a part of what differs.
TEST(AnotherController, IsNoWrongScale) {
  const MemoryLog log = closed_loop_log();
  NominalStage nominal = small_nominal();
  nominal.controller = [](double hz) {
    return Eigen::MatrixXcd((hz > 30.0 ? -3.0 : -2.0) *
                            test::small_stage().controller(2.0 * std::numbers::pi * hz));
  };
  const std::vector<Finding> found = health_of(log, nominal);
  EXPECT_EQ(first_with(found, Cause::scale), nullptr);
  expect_finding(found, Cause::controller, Severity::doubt, "", "different controller");
  expect_finding(found, Cause::controller, Severity::doubt, "", "setpoint");
}

// Otherwise a wrong sample rate or unit would be found as a wrong scale of all sensors.
TEST(AnotherStageFile, IsToldByItsSampleRateAndItsUnits) {
  const MemoryLog log = closed_loop_log();
  NominalStage nominal = small_nominal();
  nominal.sample_rate_hz = log.log_info.sample_rate_hz;
  nominal.sensor_units = log.log_info.sensors.units;
  nominal.actuator_units = log.log_info.actuators.units;
  EXPECT_EQ(first_with(health_of(log, nominal), Cause::controller), nullptr);
  NominalStage faster = nominal;
  faster.sample_rate_hz *= 2.0;
  expect_finding(health_of(log, faster), Cause::controller, Severity::fault, "",
                 "does not belong to the stage file");
  NominalStage other_unit = nominal;
  other_unit.sensor_units[1] = "m/s^2";
  const std::vector<Finding> found = health_of(log, other_unit);
  expect_finding(found, Cause::controller, Severity::fault, "", "does not belong");
  EXPECT_THAT(first_with(found, Cause::controller)->figure, HasSubstr("z2"));
}

/// The sensors show only noise, and u = r - C y.
MemoryLog log_without_response() {
  MemoryLog log = closed_loop_log(1, 0.3);
  const MemoryLog silent = closed_loop_log(1, 0.0);
  for (std::size_t e = 0; e < log.records.size(); ++e) {
    log.records[e].sensors -= silent.records[e].sensors;
    log.records[e].actuators -= silent.records[e].actuators;
    const Eigen::MatrixXd& period = log.excitation_periods[e];
    for (Eigen::Index n = 0; n < log.records[e].actuators.rows(); ++n)
      log.records[e].actuators.row(n) += period.row(n % period.rows());
  }
  return log;
}

// The controller explains u. The motion hides a response that the rigid body lets expect below it, not one far above.
TEST(OscillatingLoop, IsNoCaseOfDeadSensors) {
  const MemoryLog log = log_without_response();
  NominalStage nominal = small_nominal();
  for (const double response : {1e-6, 1e6}) {
    nominal.rigid_body = [response](double) -> Eigen::MatrixXcd {
      return response * Eigen::MatrixXcd::Ones(2, 3);
    };
    const std::vector<Finding> found = health_of(log, nominal);
    EXPECT_EQ(first_with(found, Cause::dead), nullptr);
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found[0].severity, Severity::fault);
    EXPECT_EQ(found[0].cause, Cause::incoherent);
    EXPECT_EQ(found[0].what.find("oscillates") != std::string::npos, response < 1.0);
  }
}

TEST(UnknownStage, IsSaidFirstWithTheFlagThatHelps) {
  MemoryLog log = closed_loop_log();
  const std::vector<Finding> found = health_of(log);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].severity, Severity::unchecked);
  EXPECT_EQ(found[0].cause, Cause::unknown_stage);
  EXPECT_THAT(found[0].remedy, HasSubstr("--stage FILE"));
  EXPECT_THAT(found[0].figure, HasSubstr("over 3 experiments"));
  for (LogSamples& record : log.records) record.sensors.col(0).setConstant(0.0);
  EXPECT_EQ(health_of(log)[0].cause, Cause::dead);  // a fault precedes unchecked properties
  EXPECT_EQ(health_of(log)[1].cause, Cause::unknown_stage);
}

TEST(Feedback, IsOneFunctionOfTheSensorsInASoundLog) {
  int wrong = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const MemoryLog log = closed_loop_log(seed);
    const FeedbackCheck check = check_feedback(read_health_record({&log}, {}));
    ASSERT_TRUE(check.unchecked.empty()) << check.unchecked;
    EXPECT_LT(check.relative, 1e-2);
    if (!check.inconsistent.empty()) ++wrong;
  }
  EXPECT_EQ(wrong, 0);
}

// The controller of one experiment has half the gain.
TEST(Feedback, OfAnotherControllerInOneExperimentIsNot) {
  MemoryLog log = closed_loop_log();
  test::ClosedLoop other = test::small_stage();
  other.controller = [](double omega) {
    return Eigen::MatrixXcd(0.5 * test::small_stage().controller(omega));
  };
  log.records[2] = closed_loop_log(1, 1e-3, other).records[2];
  expect_finding(health_of(log), Cause::controller, Severity::doubt, "", "not one linear function");
}

TEST(Feedback, SaysWhatItNeeds) {
  MemoryLog log = closed_loop_log();
  log.log_runs.resize(2);
  EXPECT_THAT(check_feedback(read_health_record({&log}, {})).unchecked,
              HasSubstr("more experiments than the 2 sensors"));
}

/// Faults of a log in which the loop moves a3, which is not excited. @param coupling from a1 and a2 to a3
std::vector<Finding> excluded(double coupling, std::uint64_t seed) {
  LoopExperiment x{
      .axes = 2, .realizations = 2, .periods = 4, .transient_periods = 0, .seed = seed};
  test::ClosedLoop loop = test::small_stage();
  loop.controller = [weak = loop.controller, coupling](double omega_rad_s) {
    Eigen::MatrixXcd C = weak(omega_rad_s);
    C.row(2) *= coupling;
    return C;
  };
  const auto n_y = loop.plant(1.0).rows();
  x.noise_factor =
      1e-2 * loop.plant(test::omega_of(x, 5)).norm() * Eigen::MatrixXcd::Identity(n_y, n_y);
  const MemoryLog log = test::simulate_log(loop, x);
  std::vector<Finding> findings = check_health(estimate_plant_frf_and_health({&log}).health, {});
  std::erase_if(findings, [](const Finding& f) { return f.cause != Cause::excluded; });
  return findings;
}

// Averaged over the lines, the bias counts even where it is far below the noise of each line.
TEST(DataHealth, AnUnexcitedActuatorThatMovesMoreThanTheNoiseIsAFault) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    EXPECT_EQ(excluded(1.0, seed).size(), 1U) << seed;
    EXPECT_EQ(excluded(0.1, seed).size(), 1U) << seed;
    EXPECT_TRUE(excluded(1e-4, seed).empty()) << seed;
  }
}

}  // namespace stageid::test_data_health
