#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "frf/periods/health_finding.hpp"
#include "tests/support/logs/faulty_log.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test {

inline constexpr int kFirstFlexibleMode = 6;  // of plant_modes()

/// A fault and what ought to be said of it.
struct NamedFault {
  std::string name;
  bool in_recording = false;
  PlantedFault fault;
  bool none = false;  ///< nothing may be found
  Cause cause = Cause::dead;
  std::string expected_channel;
};

struct Judgement {
  bool named =
      false;       ///< the cause at the channel, with its number; or nothing if nothing is planted
  int others = 0;  ///< other faults and doubts
  double error = 0.0;  ///< of its number: of a factor, relative; of a skew, us
};

inline std::string channel_text(const PlantedFault& fault, const LogInfo& info) {
  const auto& names = fault.of_sensor ? info.sensors.names : info.actuators.names;
  const auto name = [&](int i) { return names[i]; };
  if (fault.kind != PlantedFault::Kind::recorded_swap &&
      fault.kind != PlantedFault::Kind::wired_swap)
    return name(fault.a);
  return name(std::min(fault.a, fault.b)) + " " + name(std::max(fault.a, fault.b));
}

/// One of each kind, at channels drawn from `seed`. `clean` determines how far its channels move.
inline std::vector<NamedFault> faults_to_plant(std::uint64_t seed, const MemoryLog& clean) {
  using Kind = PlantedFault::Kind;
  RandomNumbers random(seed + 7777);
  const auto sensor = [&] { return random.integer(0, kZSensors - 1); };
  const auto actuator = [&] { return random.integer(0, kZActuators - 1); };
  const auto other = [&](int a, int count) { return (a + random.integer(1, count - 1)) % count; };
  const auto largest = [&](bool of_sensor, int channel) {
    double most = 0.0;
    for (const LogSamples& record : clean.records)
      most = std::max(
          most, (of_sensor ? record.sensors : record.actuators).col(channel).cwiseAbs().maxCoeff());
    return most;
  };
  std::vector<NamedFault> faults;
  const auto plant_at = [&](const std::string& name, const PlantedFault& fault, Cause cause,
                            const std::string& channel) {
    faults.push_back({name, name.starts_with("recorded"), fault, false, cause, channel});
  };
  const auto plant = [&](const char* name, const PlantedFault& fault, Cause cause) {
    plant_at(name, fault, cause, channel_text(fault, clean.log_info));
  };
  faults.push_back({"clean", true, {}, true, Cause::dead, ""});
  const int s = sensor();
  const int a = actuator();
  plant("recorded: sensors swapped", {Kind::recorded_swap, true, s, other(s, kZSensors)},
        Cause::swapped);
  plant("recorded: actuators swapped", {Kind::recorded_swap, false, a, other(a, kZActuators)},
        Cause::swapped);
  plant("recorded: sensor's sign", {Kind::recorded_gain, true, sensor(), 0, -1.0}, Cause::sign);
  plant("recorded: actuator's sign", {Kind::recorded_gain, false, actuator(), 0, -1.0},
        Cause::sign);
  plant("recorded: sensor x 1000", {Kind::recorded_gain, true, sensor(), 0, 1000.0}, Cause::scale);
  plant("recorded: actuator x 1000", {Kind::recorded_gain, false, actuator(), 0, 1000.0},
        Cause::scale);
  plant("recorded: sensor / 1000", {Kind::recorded_gain, true, sensor(), 0, 1e-3}, Cause::scale);
  plant("recorded: sensor 10 us late", {Kind::recorded_skew, true, sensor(), 0, 10e-6},
        Cause::skew);
  plant("recorded: actuator 10 us late", {Kind::recorded_skew, false, actuator(), 0, 10e-6},
        Cause::skew);
  plant("recorded: excitation", {Kind::mapped_excitation, false, actuator()}, Cause::injection);
  const int clipped = sensor();
  plant("recorded: sensor clipped",
        {Kind::saturation, true, clipped, 0, 0.7 * largest(true, clipped)}, Cause::saturated);
  plant("stage: actuators swapped", {Kind::wired_swap, false, a, other(a, kZActuators)},
        Cause::swapped);
  plant("stage: sensors swapped", {Kind::wired_swap, true, s, other(s, kZSensors)}, Cause::swapped);
  plant("stage: actuator's sign", {Kind::wired_gain, false, actuator(), 0, -1.0}, Cause::sign);
  plant("stage: actuator / 1000", {Kind::wired_gain, false, actuator(), 0, 1e-3}, Cause::dead);
  plant("stage: sensor 10 us late", {Kind::wired_skew, true, sensor(), 0, 10e-6}, Cause::skew);
  plant("stage: actuator 10 us late", {Kind::wired_skew, false, actuator(), 0, 10e-6}, Cause::skew);
  plant("stage: sensor dead", {Kind::dead_sensor, true, sensor()}, Cause::dead);
  plant("stage: sensor stuck", {Kind::stuck_sensor, true, sensor()}, Cause::dead);
  const int limited = actuator();
  plant("stage: actuator saturated",
        {Kind::saturation, false, limited, 0, 0.7 * largest(false, limited)}, Cause::saturated);
  plant("stage: in-plane axis excited",
        {Kind::hidden_excitation, false, random.integer(kZActuators, kZActuators + 3), 0, 0.2},
        Cause::unrecorded);
  const int runs = static_cast<int>(clean.log_runs.size());
  const int period = clean.log_info.period_samples;
  const int rows = static_cast<int>(clean.log_runs.front().samples);
  for (const int lost : {1, 3})
    plant_at(lost == 1 ? "recorded: a sample lost" : "recorded: three samples lost",
             {Kind::lost_samples, true, random.integer(0, runs - 1),
              random.integer(period + period / 10, rows - period / 10), double(lost)},
             Cause::lost_samples, "");
  plant_at("recorded: excitation late",
           {Kind::late_excitation, true, 0, 0, double(random.integer(1, 3))},
           Cause::excitation_timing, "excitation");
  plant_at("stage: a mode drifts by 0.05 %",
           {Kind::drifting_mode, true, kFirstFlexibleMode, 0, 5e-4}, Cause::drift, "");
  return faults;
}

/// The number in a figure, "factor -1 +- 0.001" or "10.02 us".
inline double figure_number(const std::string& figure) {
  const std::size_t at = figure.find_first_of("-0123456789");
  return at == std::string::npos ? 0.0 : std::strtod(figure.c_str() + at, nullptr);
}

inline Judgement judge(const NamedFault& planted, const std::vector<Finding>& findings,
                       const LogInfo&) {
  Judgement judgement;
  judgement.named = planted.none;
  for (const Finding& finding : findings) {
    if (finding.severity == Severity::unchecked) continue;
    bool right = !planted.none && finding.cause == planted.cause &&
                 finding.channel == planted.expected_channel;
    // Numbers: a factor to 10 %, a skew to 1 us.
    if (right && finding.cause == Cause::scale) {
      judgement.error = figure_number(finding.figure) / planted.fault.value - 1.0;
      right = std::abs(judgement.error) < 0.1;
    }
    if (right && finding.cause == Cause::skew) {
      judgement.error = figure_number(finding.figure) - 1e6 * planted.fault.value;
      right = std::abs(judgement.error) < 1.0;
    }
    if (right)
      judgement.named = true;
    else
      ++judgement.others;
  }
  if (planted.none && judgement.others > 0) judgement.named = false;
  return judgement;
}

}  // namespace stageid::test
