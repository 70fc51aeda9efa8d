#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <numbers>

#include "acquisition/loop/measurement_loop.hpp"
#include "tests/support/stages/stop_case.hpp"

namespace stageid {
namespace test_stop_matrix {

using Kind = WaferStageSpec::Fault::Kind;
using testing::HasSubstr;
using namespace test;

constexpr int kPeriod = 1000;
constexpr std::uint64_t kSamples = 10'000;

/// 10 N rms between 10 Hz and 1 kHz: healthy motions of 7 um and 1.1 mm/s.
LoopExcitation healthy_excitation() {
  LoopExcitation excitation;
  excitation.period = Eigen::MatrixXd::Zero(kPeriod, 1);
  constexpr int kLines = 100;
  const double amplitude = 10.0 / std::sqrt(0.5 * kLines);
  for (int line = 1; line <= kLines; ++line)
    for (int n = 0; n < kPeriod; ++n)
      excitation.period(n, 0) +=
          amplitude * std::cos(2.0 * std::numbers::pi * line * n / kPeriod +
                               std::numbers::pi * line * (line - 1) / kLines);
  excitation.actuators = {0};
  excitation.samples = kSamples;
  return excitation;
}

struct Stopped {
  StopReason reason = StopReason::none;
  std::string message;
  double largest_m = 0.0;
  double largest_n = 0.0;
  double speed_m_s = 0.0;   // when the forces were cut
  double stopping_s = 0.0;  // from the fault on
  std::uint64_t first_marked = 0;
  std::uint64_t marked = 0;
  double largest_logged_n = 0.0;
};

Stopped run(const WaferStageSpec& spec) {
  auto watched = std::make_unique<WatchedStage>(spec);
  const WatchedStage& watch = *watched;
  LimitedStage stage(std::move(watched), spec.limits);
  MotionController controller(spec.controller);
  SampleRing ring(3, 1U << 15);
  MeasurementLoop loop(stage, controller, ring, {.ramp_s = 0.1});
  loop.start(3, healthy_excitation());
  std::uint64_t cycles = 0;
  while (loop.step() == LoopStatus::running) ++cycles;
  Stopped result{loop.reason(), describe_stop(stage), watch.largest_m, watch.largest_n,
                 watch.speed_m_s()};
  result.stopping_s = (static_cast<double>(cycles) - kFaultCycle) / spec.info.sample_rate_hz;
  const auto words = ring.front(ring.capacity_rows());
  for (std::size_t at = 0; at < words.size(); at += ring.row_words()) {
    const bool marked = unpack_status(std::bit_cast<std::uint64_t>(words[at + 2])).marked;
    if (marked && result.marked++ == 0) result.first_marked = at / ring.row_words();
    result.largest_logged_n = std::max(result.largest_logged_n, std::abs(words[at]));
  }
  return result;
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
};

WaferStageSpec spec_of(const Case& c) {
  WaferStageSpec spec = stop_stage_spec(c.controller_gain);
  if (c.kind != Kind::none) {
    WaferStageSpec::Fault fault;
    fault.kind = c.kind;
    fault.from_cycle = kFaultCycle;
    fault.value = c.value;
    fault.cycles = kSamples;
    spec.faults = {fault};
  }
  return spec;
}

class StopMatrix : public testing::TestWithParam<Case> {};

TEST_P(StopMatrix, StaysInsideTwoWindows) {
  const Case& c = GetParam();
  const Stopped stopped = run(spec_of(c));
  if (std::getenv("STAGEID_STOP_TABLE") != nullptr)
    fmt::print("| {} | {:.0f} | {:.0f} | {:.3g} | {:.1f} | {} | {} |\n", c.name,
               1e6 * stopped.largest_m, stopped.largest_n, 1e3 * stopped.speed_m_s,
               1e3 * stopped.stopping_s, stopped.marked, stopped.message);
  EXPECT_LT(stopped.largest_m, c.largest_m);
  EXPECT_LE(stopped.largest_n, kStopForce);
  EXPECT_EQ(stopped.largest_logged_n, stopped.largest_n) << "the log holds what was applied";
  if (*c.cause == '\0') {
    EXPECT_EQ(stopped.reason, StopReason::none) << stopped.message;
    EXPECT_EQ(stopped.marked, 0U);
    return;
  }
  EXPECT_EQ(stopped.reason, c.reason);
  EXPECT_THAT(stopped.message, HasSubstr(c.cause));
  EXPECT_LT(stopped.speed_m_s, c.speed_m_s);
  EXPECT_GT(stopped.marked, 0U);
}

INSTANTIATE_TEST_SUITE_P(
    Sim, StopMatrix,
    testing::Values(
        Case{"healthy"},
        Case{"sign flip of the plant", Kind::actuator_gain, -1.0, 1.0, "deviation"},
        Case{"sign of the controller wrong", Kind::none, 0.0, -1.0, "stopping position"},
        Case{"sensor jumps by 300 um", Kind::sensor_offset, 300e-6, 1.0, "jumped"},
        Case{"sensor jumps by 100 um", Kind::sensor_offset, 100e-6, 1.0, "|u| would be"},
        Case{"sensor jumps by 50 um", Kind::sensor_offset, 50e-6},
        Case{"sensor shows NaN", Kind::nan_sensor, 0.0, 1.0, "not finite"},
        Case{"sensor stuck", Kind::stuck_sensor, 0.0, 1.0, "has repeated"},
        Case{"gain x3", Kind::actuator_gain, 3.0},
        Case{"gain x10", Kind::actuator_gain, 10.0, 1.0, "deviation", 2.0 * kStopWindow, 0.1},
        Case{"delay +3 samples", Kind::extra_delay, 3.0},
        Case{"delay +20 samples", Kind::extra_delay, 20.0, 1.0, "deviation", 2.0 * kStopWindow,
             0.01},
        Case{"controller gain x5", Kind::none, 0.0, 5.0, "|u| would be"},
        Case{"controller gain x30", Kind::none, 0.0, 30.0, "|u| would be"},
        // If the only actuator is dead, braking is impossible: the stage coasts at its speed.
        Case{"actuator dead", Kind::actuator_gain, 0.0, 1.0, "not braked", 2.0 * kStopWindow, 2e-3},
        // The stage continues at its speed, about 1 mm/s.
        Case{"amplifiers off (interlock)", Kind::interlock, 0.0, 1.0, "no limit", 2.0 * kStopWindow,
             2e-3, StopReason::fault},
        Case{"nothing arrives any more", Kind::missed_cycle, 0.0, 1.0, "no limit",
             2.0 * kStopWindow, 2e-3, StopReason::misses},
        // A drifting single sensor looks like a stage at rest, and the loop follows it.
        Case{"sensor drifts by 0.3 mm/s", Kind::sensor_drift, 0.3e-3}),
    [](const testing::TestParamInfo<Case>& at) {
      std::string name;
      for (const char c : std::string(at.param.name))
        if (std::isalnum(static_cast<unsigned char>(c)) != 0) name += c;
      return name;
    });

}  // namespace test_stop_matrix
}  // namespace stageid
