#include "hal/modbus/modbus_stage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "hal/modbus/modbus_encoding.hpp"
#include "hal/modbus/modbus_map.hpp"
#include "tests/hal/modbus/modbus_bench.hpp"
#include "tests/hal/modbus/numbered_registers.hpp"

namespace stageid::test_modbus_stage {

namespace map = modbus_map;
using test::ModbusBench;
using Host = test::ModbusHost;
using test::refuses;
using testing::HasSubstr;

// The smallest powers of two with which 2^31 - 1 counts cover 20 N and 20 mm.
constexpr double kForceCount_n = 0x1p-26;
constexpr double kPositionCount_m = 0x1p-36;

TEST(ModbusStage, CarriesCommandsAndMeasurementsToHalfACount) {
  ModbusBench bench;
  Host host(bench.address());
  host.start(0xFEDCBA9876543210U);
  EXPECT_NEAR(host.y[0], 1.25e-3, 0.5 * kPositionCount_m);
  EXPECT_EQ(host.inputs.valid, 1U);
  EXPECT_EQ(host.inputs.node_state, NodeState::measuring);
  EXPECT_EQ(host.exchange(0.1, -7.7), Outcome::ok);
  EXPECT_EQ(host.inputs.cycle, 1U);
  EXPECT_EQ(host.exchange(9.99, 0.0), Outcome::ok);
  host.stage.stop();
  bench.stop();
  EXPECT_EQ(bench.fake->seed, 0xFEDCBA9876543210U);
  ASSERT_EQ(bench.fake->commands.size(), 2U);
  EXPECT_NEAR(bench.fake->commands[0][0], 0.1, 0.5 * kForceCount_n);
  EXPECT_NEAR(bench.fake->commands[0][1], -7.7, 0.5 * kForceCount_n);
  EXPECT_NEAR(bench.fake->commands[1][0], 9.99, 0.5 * kForceCount_n);
}

struct FaultCase {
  const char* fault;
  bool serial;
  Outcome outcome;
  std::size_t moved;  // samples of the fake stage
  const char* trouble;
};

// Magic, description (2), state, command echo, enable, begin.
constexpr int kStartRequests = 7;

class ModbusStageFault : public testing::TestWithParam<FaultCase> {};

TEST_P(ModbusStageFault, EndsAsItShould) {
  const FaultCase& row = GetParam();
  std::string fault = row.fault;
  fault.replace(fault.find('#'), 1, "@" + std::to_string(kStartRequests + 2));
  ModbusBench bench({fault}, row.serial);
  Host host(bench.address());
  host.start();
  EXPECT_EQ(host.exchange(1.0), Outcome::ok);
  EXPECT_EQ(host.exchange(2.0), row.outcome) << host.stage.trouble();
  EXPECT_THAT(host.stage.trouble(), HasSubstr(row.trouble));
  if (row.outcome == Outcome::late) {
    EXPECT_EQ(host.exchange(3.0), Outcome::ok);
  }
  host.stage.stop();
  bench.stop();
  EXPECT_EQ(bench.fake->commands.size(), row.moved) << "moved twice, or not at all";
}

INSTANTIATE_TEST_SUITE_P(
    Table, ModbusStageFault,
    testing::Values(FaultCase{"late_reply#:0.6", false, Outcome::late, 3, ""},
                    FaultCase{"late_reply#:0.6", true, Outcome::late, 3, ""},
                    FaultCase{"half_frame#", false, Outcome::late, 3, ""},
                    FaultCase{"half_frame#", true, Outcome::late, 3, ""},
                    FaultCase{"wrong_unit#", false, Outcome::late, 3, ""},
                    FaultCase{"wrong_unit#", true, Outcome::late, 3, ""},
                    FaultCase{"exception#:6", false, Outcome::late, 3, ""},
                    FaultCase{"half_frame#x2", false, Outcome::link_down, 2, "no reply within"},
                    FaultCase{"half_frame#x2", true, Outcome::link_down, 2, "no reply within"},
                    FaultCase{"wrong_unit#x2", false, Outcome::corrupt, 2, "do not match"},
                    FaultCase{"wrong_unit#x2", true, Outcome::corrupt, 2, "was corrupt"},
                    FaultCase{"exception#x2:4", false, Outcome::fault, 1, "refused"},
                    FaultCase{"dead_server#", false, Outcome::link_down, 1, "not connected"},
                    FaultCase{"interlock#", false, Outcome::fault, 1, "interlock"}));

TEST(ModbusStage, TheArrivalOfAReplyIsStampedOnTheWallClock) {
  ModbusBench bench({"late_reply@" + std::to_string(kStartRequests + 2) + ":0.01"});
  Host host(bench.address(), ModbusBench::info(), {.pace = 1.0});
  EXPECT_TRUE(host.stage.info().stamps);
  host.start();
  for (int n = 0; n < 2; ++n) {
    const std::int64_t sent_ns = host.inputs.t_sample_ns;
    static_cast<void>(host.exchange());
    EXPECT_EQ(host.inputs.stamp_ns, host.inputs.t_arrival_ns);
    EXPECT_FALSE(host.inputs.stamp_of_stage);
    EXPECT_GE(host.inputs.t_arrival_ns - sent_ns, n == 1 ? 10'000'000 : 0) << "half a period late";
  }
  host.stage.stop();
  bench.stop();
}

TEST(ModbusStage, ACommandThatIsNoNumberIsNotSent) {
  ModbusBench bench;
  Host host(bench.address());
  host.start();
  EXPECT_EQ(host.exchange(std::numeric_limits<double>::quiet_NaN()), Outcome::fault);
  EXPECT_THAT(host.stage.trouble(), HasSubstr("not finite"));
  EXPECT_EQ(host.exchange(1e9), Outcome::fault);
  EXPECT_THAT(host.stage.trouble(), HasSubstr("exceeds the range"));
  host.stage.stop();
  bench.stop();
  EXPECT_TRUE(bench.fake->commands.empty());
}

TEST(ModbusStage, DisablesOnlyWhatItEnabled) {
  ModbusBench bench;
  Host host(bench.address());
  EXPECT_EQ(host.exchange(0.0), Outcome::fault) << "not started";
  host.start();
  host.stage.stop();
  EXPECT_EQ(bench.node().state(), NodeState::switch_on_disabled);
  ASSERT_TRUE(bench.node().request(SupervisorCommand::enable).accepted);
  host.start();
  host.stage.stop();
  EXPECT_EQ(bench.node().state(), NodeState::operation_enabled);
}

/// A start on this bench.
auto starting(const ModbusBench& bench, const StageInfo& info = ModbusBench::info()) {
  return [&bench, info] { Host(bench.address(), info).start(); };
}

TEST(ModbusStage, StartsOnNothingButItsOwnStage) {
  const ModbusBench bench;
  StageInfo info = ModbusBench::info();
  info.sample_rate_hz = 51.0;
  EXPECT_THAT(starting(bench, info), refuses("50 Hz, the stage file has 51 Hz"));
  Inputs wrong_size;
  ModbusStage stage(ModbusBench::info(), bench.address(), test::kQuickTiming);
  EXPECT_THROW(stage.start(1, wrong_size), std::invalid_argument);
  EXPECT_NO_THROW(starting(bench)());
}

TEST(ModbusStage, SaysWhyAStageDoesNotStart) {
  NodePanel panel = test::good_panel();
  panel.interlock_closed = false;
  const ModbusBench locked({}, false, 1.0, panel);
  EXPECT_THAT(starting(locked), refuses("the interlock is open"));

  test::NumberedRegisters foreign;
  const test::ServerThread server(foreign, nullptr);
  EXPECT_THROW(Host(server.address()).start(), StageError);
}

/// A transmitted setpoint; the reply's sequence and missed count.
std::pair<std::uint32_t, std::uint32_t> setpoint(ModbusClient& link, std::uint32_t session,
                                                 std::uint32_t sequence) {
  std::array<std::uint16_t, 8> request{};
  const RegisterBlock out(map::kRunKey, request);
  out.set_u32(map::kRunKey, session);
  out.set_u32(map::kSetpointSequence, sequence);
  std::array<std::uint16_t, 8> reply{};
  EXPECT_EQ(link.exchange(map::kRunKey, request, map::kMeasurementBootId, reply), LinkStatus::ok);
  const RegisterBlock replied(map::kMeasurementBootId, reply);
  return {replied.u32(map::kMeasurementSequence), replied.u32(map::kMeasurementStatus) >> 24};
}

TEST(ModbusNode, OnlyANewerSetpointMovesTheStage) {
  ModbusBench bench;
  ASSERT_TRUE(bench.node().request(SupervisorCommand::enable).accepted);
  ModbusClient link(bench.address(), test::kQuickTiming);
  link.connect();
  std::vector<std::uint16_t> reply(14);
  const std::uint32_t session = begin_run(link, 3, reply);
  EXPECT_EQ(setpoint(link, session, 1), std::pair(1U, 0U));
  EXPECT_EQ(setpoint(link, session, 1), std::pair(1U, 0U));
  EXPECT_EQ(setpoint(link, session, 4), std::pair(4U, 2U)) << "two were left out";
  EXPECT_EQ(setpoint(link, session, 2), std::pair(4U, 2U)) << "an old one";
  bench.stop();
  EXPECT_EQ(bench.fake->commands.size(), 2U);
}

TEST(ModbusNode, RefusesWhatTheMapCannotShow) {
  NodePanel panel = test::good_panel();
  panel.temperature_k.assign(9, 295.0);
  EXPECT_THROW(ModbusBench({}, false, 1.0, panel), std::invalid_argument);
  panel.temperature_k.clear();
  EXPECT_THROW(ModbusBench({"temperature:400"}, false, 1.0, panel), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(modbus_scales(Eigen::VectorXd(), 2, "actuator")),
               std::invalid_argument);
}

}  // namespace stageid::test_modbus_stage
