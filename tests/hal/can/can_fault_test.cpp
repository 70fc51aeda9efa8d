#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "hal/can/can_stage.hpp"
#include "hal/can/faulty_can.hpp"
#include "tests/hal/can/can_host.hpp"
#include "tests/hal/stage_bench.hpp"

namespace stageid::test_can_fault {

using test::all_ok;
using test::CanRig;
using Host = test::CanHost;
using Running = test::RunningCanHost;
using Wire = test::CanRigOptions;

/// One row of the fault table: the faults of the wire, the host's result, the counts of both sides.
struct Row {
  const char* name;
  std::vector<std::string> node_faults;  // of measurements; frame 0 is y[0]
  std::vector<std::string> host_faults;  // of setpoints
  Outcome third = Outcome::ok;           // outcome of u[2]; all others are ok
  CanCounts counts = {};
  std::uint32_t gaps = 0;
  std::uint32_t repeated = 0;
  std::uint32_t rejected = 0;
  std::uint64_t samples = 10;
};

class WallClockFaults : public testing::TestWithParam<Row> {};

// On the wall clock nothing is repeated: a fault affects only its own sample.
TEST_P(WallClockFaults, CostTheirSampleOnly) {
  const Row& row = GetParam();
  CanRig rig(Wire{row.host_faults, row.node_faults});
  Running host(rig, {1e3, false});
  std::vector<Outcome> expected = all_ok(10);
  expected[2] = row.third;
  std::vector<Outcome> outcomes;
  for (int n = 0; n < 10; ++n) {
    outcomes.push_back(host.exchange());
    rig.pair().pass_time(1'000'000);
  }
  EXPECT_EQ(outcomes, expected);
  const CanCounts& counts = host.stage().counts();
  EXPECT_EQ(counts.repeats, 0U);
  EXPECT_EQ(counts.old, row.counts.old);
  EXPECT_EQ(counts.damaged, row.counts.damaged);
  EXPECT_EQ(counts.foreign, row.counts.foreign);
  EXPECT_EQ(rig.node().sample(), row.samples);
  EXPECT_EQ(rig.node().state(), NodeState::measuring);
  host.stage().stop();
  EXPECT_EQ(host.stage().node().gaps, row.gaps);
  EXPECT_EQ(host.stage().node().repeated, row.repeated);
  EXPECT_EQ(host.stage().node().rejected, row.rejected);
}

INSTANTIATE_TEST_SUITE_P(
    CanStage, WallClockFaults,
    testing::Values(
        Row{"answer lost", {"lost@3"}, {}, Outcome::stale},
        Row{"answer twice", {"repeated@3"}, {}, Outcome::ok, {0, 1}},
        Row{"answer behind the next", {"swapped@3"}, {}, Outcome::stale, {0, 1}},
        Row{"answer late, in time", {"late@3:0.003"}, {}, Outcome::ok},
        Row{"answer too late", {"late@3:0.007"}, {}, Outcome::stale, {0, 1}},
        Row{"answer damaged", {"corrupt@3"}, {}, Outcome::corrupt, {0, 0, 1}},
        Row{"answer short", {"shortened@3"}, {}, Outcome::corrupt, {0, 0, 1}},
        Row{"answer under another name", {"foreign@3"}, {}, Outcome::stale, {0, 0, 0, 1}},
        Row{"setpoint lost", {}, {"lost@2"}, Outcome::stale, {}, 1, 0, 0, 9},
        Row{"setpoint twice", {}, {"repeated@2"}, Outcome::ok, {0, 1}, 0, 1, 0},
        Row{"setpoint behind the next", {}, {"swapped@2"}, Outcome::stale, {}, 1, 1, 0, 9},
        Row{"setpoint late, in time", {}, {"late@2:0.003"}, Outcome::ok},
        Row{"setpoint too late", {}, {"late@2:0.0055"}, Outcome::stale, {}, 1, 1, 0, 9},
        Row{"setpoint damaged", {}, {"corrupt@2"}, Outcome::stale, {}, 1, 0, 1, 9},
        Row{"setpoint short", {}, {"shortened@2"}, Outcome::stale, {}, 1, 0, 1, 9},
        Row{"setpoint under another name", {}, {"foreign@2"}, Outcome::stale, {}, 1, 0, 1, 9}),
    [](const auto& row) { return test::test_name(row.param.name); });

// In virtual time nothing moves while the host asks again, so the run equals that without the fault.
TEST(CanStage, InVirtualTimeSingleFaultsHeal) {
  const std::vector<double> y = test::undisturbed_can_run(20);
  for (const char* fault : {"lost@3", "corrupt@3", "shortened@3", "foreign@3", "swapped@3",
                            "late@3:0.007", "repeated@3", "lost@3x3"}) {
    for (const bool of_host : {false, true}) {
      test::CanRigOptions options;
      (of_host ? options.host_faults : options.node_faults) = {fault};
      CanRig rig(options);
      Running host(rig);
      for (std::size_t n = 0; n < 20; ++n) {
        ASSERT_EQ(host.exchange(), Outcome::ok) << fault << " " << of_host << " " << n;
        ASSERT_EQ(host.y()[0], y[n]) << fault << " " << of_host << " " << n;
      }
      EXPECT_EQ(rig.node().sample(), 20U);
    }
  }
}

TEST(CanFaults, AreReadOrRefused) {
  const CanFault fault = parse_can_fault("late@100x3:0.004");
  EXPECT_EQ(fault.kind, CanFaultKind::late);
  EXPECT_EQ(fault.from_frame, 100U);
  EXPECT_EQ(fault.frames, 3U);
  EXPECT_EQ(fault.delay_s, 0.004);
  for (const char* text :
       {"", "lost", "lost@", "broken@3", "lost@-1", "late@3", "late@3:-1", "late@3:..", "lost@3x"})
    EXPECT_THROW(parse_can_fault(text), std::invalid_argument) << text;
}

}  // namespace stageid::test_can_fault
