#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <set>
#include <string>
#include <vector>

#include "excitation/plan/experiment_plan.hpp"
#include "excitation/words/words.hpp"
#include "hal/simulator/fault_script.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {

/// What can go wrong while an experiment runs.
enum class Trouble : std::uint8_t {
  stage_fault,  ///< of SimulationSpec
  loud,         ///< the excitation exceeds limits
  wire,         ///< frames are lost, damaged, repeated or come in another order
  cut,          ///< no frame arrives any more
  bus,          ///< the bus is off
  interlock,    ///< of the node's panel
  interrupted,  ///< by the user
  tripped,      ///< by a condition of the plant
  disk,         ///< the log cannot be written
  killed        ///< or without power: what was not synchronized is lost or damaged
};

}  // namespace stageid::test

namespace stageid {
template <>
inline constexpr std::array kWords<test::Trouble> = {
    "stage fault", "loud",        "wire",    "cut",  "bus",
    "interlock",   "interrupted", "tripped", "disk", "killed"};
}  // namespace stageid

namespace stageid::test {

/// What goes wrong in one attempt, and when: counted in exchanges of the attempt, or calls of the log.
struct Misfortune {
  std::set<Trouble> troubles;
  std::uint64_t at = 0;
  int log_call = -1;
  double frames_spoiled = 0.0;
  SimulationSpec::Fault fault;

  bool has(Trouble trouble) const { return troubles.contains(trouble); }
  bool has_any(std::initializer_list<Trouble> causes) const {
    return std::any_of(causes.begin(), causes.end(), [&](Trouble cause) { return has(cause); });
  }
  std::string describe() const {
    std::string text;
    for (const Trouble trouble : troubles) text += fmt::format("{}, ", to_string(trouble));
    return text + fmt::format("exchange {}, call {} of the log, fault {} {} from {} of run {}", at,
                              log_call, to_string(fault.kind), fault.value, fault.from_cycle,
                              fault.run);
  }
};

inline SimulationSpec::Fault draw_fault(RandomNumbers& random, const StageInfo& info,
                                        std::uint64_t samples) {
  using Kind = SimulationSpec::Fault::Kind;
  struct Choice {
    Kind kind;
    double low;
    double high;
  };
  static constexpr std::array kChoices = {
      Choice{Kind::dead_sensor, 0, 0},          Choice{Kind::nan_sensor, 0, 0},
      Choice{Kind::missed_cycle, 0, 0},         Choice{Kind::interlock, 0, 0},
      Choice{Kind::stuck_actuator, 0, 0},       Choice{Kind::stuck_sensor, 0, 0},
      Choice{Kind::sensor_offset, -3e-4, 3e-4}, Choice{Kind::sensor_drift, -1e-2, 1e-2},
      Choice{Kind::actuator_gain, -3.0, 3.0},   Choice{Kind::extra_delay, 1, 40},
      Choice{Kind::sensor_gain, -1.0, 3.0},     Choice{Kind::sensor_noise, 1, 1e4}};
  const Choice& choice =
      kChoices[static_cast<std::size_t>(random.integer(0, static_cast<int>(kChoices.size()) - 1))];
  SimulationSpec::Fault fault;
  fault.kind = choice.kind;
  const bool of_sensor = fault_traits(choice.kind).target == FaultTarget::sensor;
  fault.channel = random.integer(
      0, static_cast<int>(of_sensor ? info.sensors.size() : info.actuators.size()) - 1);
  fault.from_cycle = static_cast<std::uint64_t>(random.uniform() * static_cast<double>(samples));
  fault.cycles = static_cast<std::uint64_t>(random.integer(1, 30));
  fault.run = random.integer(0, 2);
  fault.value = random.uniform(choice.low, choice.high);
  if (fault.kind == Kind::extra_delay) fault.value = std::round(fault.value);
  return fault;
}

/// `over_bus`: between host and stage
inline Misfortune draw_misfortune(RandomNumbers& random, bool over_bus, const StageInfo& info,
                                  const ExperimentPlan& plan) {
  std::vector<Trouble> possible = {Trouble::stage_fault, Trouble::stage_fault, Trouble::loud,
                                   Trouble::interrupted, Trouble::tripped,     Trouble::disk};
  if (over_bus)
    possible.insert(possible.end(),
                    {Trouble::wire, Trouble::cut, Trouble::bus, Trouble::interlock});
  Misfortune out;
  for (int n = random.integer(0, 2); n >= 0; --n)
    out.troubles.insert(possible[static_cast<std::size_t>(
        random.integer(0, static_cast<int>(possible.size()) - 1))]);
  if (random.uniform() < 0.5) out.troubles.insert(Trouble::killed);
  const auto samples = static_cast<std::uint64_t>(plan.samples_per_run());
  const auto runs = plan.runs().size();
  out.at = static_cast<std::uint64_t>(random.uniform() * static_cast<double>(samples * runs));
  out.log_call = random.integer(0, 4 * static_cast<int>(runs));
  out.frames_spoiled = std::pow(10.0, random.uniform(-4.0, -0.7));
  out.fault = draw_fault(random, info, samples);
  return out;
}

}  // namespace stageid::test
