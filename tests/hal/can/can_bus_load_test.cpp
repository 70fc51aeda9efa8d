#include "hal/can/can_bus_load.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/hal/can/can_rig.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_can_bus_load {

// Longest frames in microseconds, rounded, computed by a program that counts the bits of worst cases
// (11-bit identifiers, 1 Mbit/s nominal).
TEST(CanBusLoad, FrameTimesAgreeWithCountedBits) {
  struct Row {
    std::size_t bytes;
    double at_2m_us, at_5m_us, at_8m_us;
  };
  for (const Row& row :
       {Row{64, 373, 170, 119}, Row{32, 213, 106, 79}, Row{8, 91, 57, 48}, Row{0, 51, 41, 38}}) {
    // Half a microsecond of rounding.
    EXPECT_NEAR(1e6 * can_fd_frame_time_s(row.bytes, 1e6, 2e6), row.at_2m_us, 0.501);
    EXPECT_NEAR(1e6 * can_fd_frame_time_s(row.bytes, 1e6, 5e6), row.at_5m_us, 0.501);
    EXPECT_NEAR(1e6 * can_fd_frame_time_s(row.bytes, 1e6, 8e6), row.at_8m_us, 0.501);
  }
}

// 17 setpoints and 7 measurements, 64 + 32 bytes. The reference values include a synchronization frame, which this
// protocol does not have.
TEST(CanBusLoad, AWaferStageAsInTheTable) {
  const StageInfo info = test::silent_wafer_stage_spec().info;
  struct Row {
    double data_bit_rate_hz, cycle_us, sync_us;
  };
  for (const Row& row : {Row{2e6, 637, 51}, Row{5e6, 316, 41}, Row{8e6, 236, 38}}) {
    const CanSpec spec = test::one_bus_spec(info, row.data_bit_rate_hz);
    const LinkLoad load = can_bus_load(spec, can_layout(spec, info), 1e3).front();
    EXPECT_NEAR(1e6 * load.cycle_s, row.cycle_us - row.sync_us, 1.0);
    // Ten state frames of 48 bytes a second beside it.
    const double heartbeat = 10.0 * can_fd_frame_time_s(48, 1e6, row.data_bit_rate_hz);
    EXPECT_NEAR(load.load, 1e3 * load.cycle_s + heartbeat, 1e-12);
    EXPECT_NEAR(load.most_hz * load.cycle_s + heartbeat, 0.8, 1e-12);
  }
}

TEST(CanBusLoad, WhatABusCannotCarryIsRefusedWithTheLoad) {
  const StageInfo info = test::silent_wafer_stage_spec().info;
  const CanSpec spec = test::one_bus_spec(info, 5e6);
  const CanLayout layout = can_layout(spec, info);
  EXPECT_NO_THROW(require_bus_carries(spec, layout, 2500.0));
  // (34 + 678 / 5) + (34 + 358 / 5) us
  EXPECT_EQ(
      test::error_message<std::invalid_argument>([&] { require_bus_carries(spec, layout, 1e4); }),
      "can: can0 would have a load of 275 % at 10000 Hz (275 us per cycle); the limit is "
      "80 %. Use at most 2902 Hz, more buses, or mode: resident");
}

TEST(CanBusLoad, EveryBusCarriesItsOwnOnly) {
  const StageInfo info = test::silent_wafer_stage_spec().info;
  CanSpec spec = test::one_bus_spec(info, 5e6);
  spec.buses.push_back({"can1", 1e6, 5e6, {}, spec.buses[0].sensors});
  spec.buses[0].sensors.clear();
  const auto loads = can_bus_load(spec, can_layout(spec, info), 1e3);
  ASSERT_EQ(loads.size(), 2U);
  EXPECT_DOUBLE_EQ(loads[0].cycle_s, can_fd_frame_time_s(64, 1e6, 5e6));
  EXPECT_DOUBLE_EQ(loads[1].cycle_s, can_fd_frame_time_s(32, 1e6, 5e6));
  EXPECT_DOUBLE_EQ(loads[1].load, 1e3 * loads[1].cycle_s) << "heartbeats are on the first bus";
}

}  // namespace stageid::test_can_bus_load
