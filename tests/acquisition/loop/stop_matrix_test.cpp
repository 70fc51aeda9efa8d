#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>
#include <tuple>

#include "tests/acquisition/loop/stop_links.hpp"

namespace stageid {
namespace test_stop_matrix {

using Kind = WaferStageSpec::Fault::Kind;
using testing::HasSubstr;
using namespace test;

struct Case {
  const char* name;
  Kind kind = Kind::none;
  double value = 0.0;
  double controller_gain = 1.0;
  const char* cause = "";  // in the message; empty: the loop continues
  double largest_m = 2.0 * kStopWindow;
  double speed_m_s = 1e-3;  // when the forces were cut
  StopReason reason = StopReason::limit;
  LinkEvent event = LinkEvent::none;
  /// In the message over a link with a node; empty: as `cause`.
  const char* cause_of_link = "";
};

std::string cause_over(StopLink link, const Case& c) {
  const bool node = link != StopLink::sim && link != StopLink::plugin;
  return node && *c.cause_of_link != '\0' ? c.cause_of_link : c.cause;
}

int exit_code_of(const Case& c) {
  if (*c.cause == '\0') return 0;
  return c.reason == StopReason::limit ? 4 : 1;
}

WaferStageSpec spec_of(const Case& c) {
  WaferStageSpec spec = stop_stage_spec(c.controller_gain);
  if (c.kind != Kind::none) {
    WaferStageSpec::Fault fault;
    fault.kind = c.kind;
    fault.from_cycle = kFaultCycle;
    fault.value = c.value;
    fault.cycles = kStopSamples;
    spec.faults = {fault};
  }
  return spec;
}

class StopMatrix : public testing::TestWithParam<std::tuple<StopLink, Case>> {};

TEST_P(StopMatrix, StaysInsideTwoWindows) {
  const auto& [link, c] = GetParam();
  const Stopped stopped = stop_over(link, spec_of(c), c.event);
  if (std::getenv("STAGEID_STOP_TABLE") != nullptr)
    fmt::print("| {} | {} | {:.0f} | {:.0f} | {:.0f} | {:.3g} | {:.1f} | {} | {} | {} |\n", c.name,
               to_string(link), 1e6 * stopped.largest_m, 1e6 * stopped.coasted_m, stopped.largest_n,
               1e3 * stopped.speed_m_s, 1e3 * stopped.stopping_s, stopped.marked,
               stopped.host_lost ? "-" : std::to_string(stopped.exit_code()), stopped.message);
  EXPECT_LT(stopped.largest_m, c.largest_m);
  EXPECT_LE(stopped.largest_n, kStopForce);
  const bool in_process = link == StopLink::sim || link == StopLink::plugin;
  if (in_process) {
    EXPECT_EQ(stopped.largest_logged_n, stopped.largest_n) << "the log holds what was applied";
  }
  EXPECT_LT(stopped.speed_m_s, c.speed_m_s);
  if (stopped.host_lost) return;
  EXPECT_EQ(stopped.exit_code(), exit_code_of(c));
  if (*c.cause == '\0') {
    EXPECT_EQ(stopped.reason, StopReason::none) << stopped.message;
    EXPECT_EQ(stopped.marked, 0U);
    return;
  }
  EXPECT_THAT(stopped.message, HasSubstr(cause_over(link, c)));
  // The trace of a node ends before the sample that stopped it.
  if (link != StopLink::resident && link != StopLink::zeromq) {
    EXPECT_GT(stopped.marked, 0U);
  }
}

const auto kFaults = testing::Values(
    Case{"healthy"}, Case{"sign flip of the plant", Kind::actuator_gain, -1.0, 1.0, "deviation"},
    Case{"sign of the controller wrong", Kind::none, 0.0, -1.0, "stopping position"},
    Case{"sensor jumps by 300 um", Kind::sensor_offset, 300e-6, 1.0, "jumped"},
    Case{"sensor jumps by 100 um", Kind::sensor_offset, 100e-6, 1.0, "|u| would be"},
    Case{"sensor jumps by 50 um", Kind::sensor_offset, 50e-6},
    Case{"sensor shows NaN", Kind::nan_sensor, 0.0, 1.0, "not finite"},
    Case{"sensor stuck", Kind::stuck_sensor, 0.0, 1.0, "has repeated"},
    Case{"gain x3", Kind::actuator_gain, 3.0},
    Case{"gain x10", Kind::actuator_gain, 10.0, 1.0, "deviation", 2.0 * kStopWindow, 0.1},
    Case{"delay +3 samples", Kind::extra_delay, 3.0},
    Case{"delay +20 samples", Kind::extra_delay, 20.0, 1.0, "deviation", 2.0 * kStopWindow, 0.01},
    Case{"controller gain x5", Kind::none, 0.0, 5.0, "|u| would be"},
    Case{"controller gain x30", Kind::none, 0.0, 30.0, "|u| would be"},
    // If the only actuator is dead, braking is impossible: the stage coasts at its speed.
    Case{"actuator dead", Kind::actuator_gain, 0.0, 1.0, "not braked", 2.0 * kStopWindow, 2e-3,
         StopReason::limit, LinkEvent::none, "deviation"},
    // The stage continues at its speed, about 1 mm/s.
    Case{"amplifiers off (interlock)", Kind::interlock, 0.0, 1.0, "no limit", 2.0 * kStopWindow,
         2e-3, StopReason::fault, LinkEvent::none, "fault"},
    Case{"nothing arrives any more", Kind::missed_cycle, 0.0, 1.0, "no limit", 2.0 * kStopWindow,
         2e-3, StopReason::misses, LinkEvent::none, "no"},
    // A drifting single sensor looks like a stage at rest, and the loop follows it.
    Case{"sensor drifts by 0.3 mm/s", Kind::sensor_drift, 0.3e-3});

const auto kLinkEvents =
    testing::Values(Case{"wire lost", Kind::none, 0.0, 1.0, "no", 2.0 * kStopWindow, 2e-3,
                         StopReason::fault, LinkEvent::wire_lost},
                    Case{"host killed", Kind::none, 0.0, 1.0, "", 2.0 * kStopWindow, 2e-3,
                         StopReason::none, LinkEvent::host_killed});

std::string name_of(const testing::TestParamInfo<StopMatrix::ParamType>& at) {
  const auto& [link, c] = at.param;
  std::string name;
  for (const char letter : fmt::format("{}_{}", to_string(link), c.name))
    if (std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '_') name += letter;
  return name;
}

enum class Strategy : std::uint8_t { ramp, cut, brake };

WaferStageSpec with_strategy(WaferStageSpec spec, Strategy strategy) {
  if (strategy == Strategy::ramp) {  // nothing is predicted, so the loop stays closed
    spec.limits.motion = {};
    spec.limits.hard_window_m = Eigen::VectorXd::Constant(1, 1.0);
  }
  if (strategy == Strategy::cut) spec.limits.motion.force_per_acceleration.setZero();
  return spec;
}

class StopStrategies : public testing::TestWithParam<Case> {};

// Excursion until a second after the forces were cut.
TEST_P(StopStrategies, TheBrakeIsTheOnlyOneThatStopsEverything) {
  const Case& c = GetParam();
  std::array<Stopped, 3> by;
  for (std::size_t i = 0; i < by.size(); ++i)
    by[i] = stop_over(StopLink::sim, with_strategy(spec_of(c), static_cast<Strategy>(i)), c.event);
  const auto excursion = [](const Stopped& stopped) {
    return std::max(stopped.largest_m, stopped.coasted_m);
  };
  if (std::getenv("STAGEID_STOP_TABLE") != nullptr) {
    fmt::print("| {} |", c.name);
    for (const Stopped& stopped : by)
      fmt::print(" {:.0f}, {:.3g} mm/s, {:.0f} |", 1e6 * stopped.largest_m, 1e3 * stopped.speed_m_s,
                 1e6 * excursion(stopped));
    fmt::print("\n");
  }
  const Stopped& brake = by[static_cast<std::size_t>(Strategy::brake)];
  for (const Stopped& stopped : by) EXPECT_LE(excursion(brake), 1.5 * excursion(stopped));
  EXPECT_LT(brake.largest_m, 2.0 * kStopWindow);
}

INSTANTIATE_TEST_SUITE_P(Faults, StopStrategies, kFaults, [](const auto& at) {
  std::string name;
  for (const char letter : std::string(at.param.name))
    if (std::isalnum(static_cast<unsigned char>(letter)) != 0) name += letter;
  return name;
});
INSTANTIATE_TEST_SUITE_P(Faults, StopMatrix,
                         testing::Combine(testing::Values(StopLink::sim, StopLink::plugin,
                                                          StopLink::can, StopLink::resident,
                                                          StopLink::modbus, StopLink::zeromq),
                                          kFaults),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Links, StopMatrix,
                         testing::Combine(testing::Values(StopLink::can, StopLink::resident,
                                                          StopLink::modbus, StopLink::zeromq),
                                          kLinkEvents),
                         name_of);

}  // namespace test_stop_matrix
}  // namespace stageid
