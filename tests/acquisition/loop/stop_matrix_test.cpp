#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "tests/acquisition/loop/stop_links.hpp"
#include "tests/hal/stage_bench.hpp"
#include "tests/support/process/docs_table.hpp"

namespace stageid::test_stop_matrix {

using Kind = SimulationSpec::Fault::Kind;
using testing::HasSubstr;
using namespace test;

// The tables of docs/stops.md, whose cells are results of tests. With the environment variable STAGEID_STOP_TABLE, the
// tests write their cells instead of comparing them.

/// A value with a unit is measured and may differ by 5 % or two units; a count or a word may not.
bool same_value(const std::string& a, const std::string& b) {
  if (a == b) return true;
  std::array<std::string, 2> units;
  std::array<double, 2> values{};
  std::istringstream(a) >> values[0] >> units[0];
  std::istringstream(b) >> values[1] >> units[1];
  return !units[0].empty() && units[0] == units[1] &&
         std::abs(values[0] - values[1]) <= 2.0 + 0.05 * std::abs(values[0]);
}

/// Compares `found` ("176 um, 650 N, 24 ms, 4, 134") with the cell of this row and column.
void expect_in_docs(const std::string& row, const std::string& column, const std::string& found) {
  const std::string file = STAGEID_SOURCE_DIR "/docs/stops.md";
  std::ifstream in(file);
  std::vector<std::string> lines = split(std::string(std::istreambuf_iterator<char>(in), {}), "\n");
  const auto head = std::find_if(lines.begin(), lines.end(), [&](const std::string& line) {
    return line.starts_with("| fault |") && line.find("| " + column + " |") != std::string::npos;
  });
  const auto line = std::find_if(head, lines.end(), [&](const std::string& text) {
    return text.starts_with("| " + row + " |");
  });
  ASSERT_NE(line, lines.end()) << "docs/stops.md has no row '" << row << "' or column '" << column
                               << "'";
  const auto columns = split(*head, " | ");
  auto cells = split(*line, " | ");
  ASSERT_EQ(cells.size(), columns.size()) << *line;
  std::size_t at = 0;
  while (columns[at] != column && columns[at] != column + " |") ++at;
  std::string& cell = cells[at];
  const std::string end = at + 1 == cells.size() ? " |" : "";
  if (std::getenv("STAGEID_STOP_TABLE") != nullptr) {
    cell = found + end;
    *line = cells[0];
    for (std::size_t i = 1; i < cells.size(); ++i) *line += " | " + cells[i];
    std::ofstream out(file);
    for (std::size_t i = 0; i < lines.size(); ++i)
      out << lines[i] << (i + 1 < lines.size() ? "\n" : "");
    return;
  }
  const auto told = split(cell.substr(0, cell.size() - end.size()), ", ");
  const auto now = split(found, ", ");
  EXPECT_TRUE(std::equal(told.begin(), told.end(), now.begin(), now.end(), same_value))
      << "docs/stops.md, '" << row << "', '" << column << "': " << cell << ", but found " << found
      << "; STAGEID_STOP_TABLE=1 writes it";
}

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

test::SimulatedSpec spec_of(const Case& c) {
  test::SimulatedSpec spec = stop_stage_spec(c.controller_gain);
  if (c.kind != Kind::none)
    spec.simulation.faults = {
        {.kind = c.kind, .from_cycle = kFaultCycle, .cycles = kStopSamples, .value = c.value}};
  return spec;
}

std::string length(double m) {
  if (m < 1e-3) return fmt::format("{:.0f} um", 1e6 * m);
  return m < 1.0 ? fmt::format("{:.3g} mm", 1e3 * m) : fmt::format("{:.3g} m", m);
}

/// A wrong controller is wrong from the start.
std::string time_to_rest(const Case& c, const Stopped& stopped) {
  const double before_s =
      c.controller_gain != 1.0 ? kFaultCycle / stop_stage_spec().info.sample_rate_hz : 0.0;
  return fmt::format("{:.0f} ms", 1e3 * (stopped.stopping_s + before_s));
}

class StopMatrix : public testing::TestWithParam<std::tuple<StopLink, Case>> {};

TEST_P(StopMatrix, StaysInsideTwoWindows) {
  const auto& [link, c] = GetParam();
  const Stopped stopped = stop_over(link, spec_of(c), c.event);
  expect_in_docs(
      c.name, to_string(link),
      fmt::format("{}, {:.0f} N, {}, {}, {}", length(stopped.largest_m), stopped.largest_n,
                  *c.cause == '\0' && !stopped.host_lost ? "-" : time_to_rest(c, stopped),
                  stopped.host_lost ? "-" : std::to_string(stopped.exit_code()),
                  stopped.host_lost ? "-" : std::to_string(stopped.marked)));
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
    Case{"none"},
    Case{"sign of the actuator reversed", Kind::actuator_gain, -1.0, 1.0, "deviation"},
    Case{"sign of the controller wrong from the start", Kind::none, 0.0, -1.0, "stopping position"},
    Case{"sensor jumps by 300 um", Kind::sensor_offset, 300e-6, 1.0, "jumped"},
    Case{"sensor jumps by 100 um", Kind::sensor_offset, 100e-6, 1.0, "|u| would be"},
    Case{"sensor jumps by 50 um", Kind::sensor_offset, 50e-6},
    Case{"sensor reads NaN", Kind::nan_sensor, 0.0, 1.0, "not finite"},
    Case{"sensor stuck", Kind::stuck_sensor, 0.0, 1.0, "has repeated"},
    Case{"gain of the actuator x 3", Kind::actuator_gain, 3.0},
    Case{"gain of the actuator x 10", Kind::actuator_gain, 10.0, 1.0, "deviation",
         2.0 * kStopWindow, 0.1},
    Case{"3 samples more delay", Kind::extra_delay, 3.0},
    Case{"20 samples more delay", Kind::extra_delay, 20.0, 1.0, "deviation", 2.0 * kStopWindow,
         0.01},
    Case{"controller gain x 5", Kind::none, 0.0, 5.0, "|u| would be"},
    Case{"controller gain x 30", Kind::none, 0.0, 30.0, "|u| would be"},
    // If the only actuator is dead, braking is impossible: the stage coasts at its speed.
    Case{"actuator dead", Kind::actuator_gain, 0.0, 1.0, "not braked", 2.0 * kStopWindow, 2e-3,
         StopReason::limit, LinkEvent::none, "deviation"},
    // The stage continues at its speed, about 1 mm/s.
    Case{"amplifiers off, a fault of the node", Kind::interlock, 0.0, 1.0, "no limit",
         2.0 * kStopWindow, 2e-3, StopReason::fault, LinkEvent::none, "fault"},
    Case{"no measurement arrives", Kind::missed_cycle, 0.0, 1.0, "no limit", 2.0 * kStopWindow,
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
  return test_name(fmt::format("{}_{}", to_string(link), c.name));
}

enum class Strategy : std::uint8_t { ramp, cut, brake };

test::SimulatedSpec with_strategy(test::SimulatedSpec spec, Strategy strategy) {
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
  constexpr std::array kColumns = {"ramp", "cut", "brake"};
  for (std::size_t i = 0; i < by.size(); ++i)
    expect_in_docs(c.name, kColumns[i],
                   fmt::format("{}, {}", length(by[i].largest_m), length(excursion(by[i]))));
  const Stopped& brake = by[static_cast<std::size_t>(Strategy::brake)];
  for (const Stopped& stopped : by) EXPECT_LE(excursion(brake), 1.5 * excursion(stopped));
  EXPECT_LT(brake.largest_m, 2.0 * kStopWindow);
}

INSTANTIATE_TEST_SUITE_P(Faults, StopStrategies, kFaults,
                         [](const auto& at) { return test_name(at.param.name); });
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

}  // namespace stageid::test_stop_matrix
