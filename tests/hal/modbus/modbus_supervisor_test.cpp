#include "hal/modbus/modbus_supervisor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "hal/modbus/modbus_map.hpp"
#include "tests/hal/modbus/modbus_bench.hpp"
#include "tests/hal/modbus/numbered_registers.hpp"

// integration.modbus_fault_matrix has late replies and a heartbeat that stands still.
namespace stageid::test_modbus_supervisor {

using test::ModbusBench;
using testing::HasSubstr;

const ModbusSupervisorOptions kQuick = {0.01, 0.02, 0.1};

bool fresh(const ModbusSupervisor& supervisor) {
  return supervisor.snapshot().t_ns != 0 && supervisor.trouble().empty();
}

TEST(ModbusSupervisor, ShowsThePlant) {
  const ModbusBench bench;
  const ModbusSupervisor supervisor(bench.address(), test::kQuickTiming, kQuick);
  ASSERT_TRUE(test::comes([&] { return fresh(supervisor); })) << supervisor.trouble();
  const PlantSnapshot snapshot = supervisor.snapshot();
  EXPECT_TRUE(snapshot.interlock_closed);
  EXPECT_FALSE(snapshot.enabled);
  EXPECT_EQ(snapshot.state, NodeState::switch_on_disabled);
  EXPECT_EQ(snapshot.gravity_compensator_n, (std::vector<double>{50.0, 51.5}));
  EXPECT_EQ(snapshot.temperature_k, std::vector<double>{295.25});
  EXPECT_TRUE(
      test::comes([&] { return supervisor.snapshot().heartbeat > snapshot.heartbeat + 2; }));
}

TEST(ModbusSupervisor, GivesEveryCommandOnceAndTellsTheAnswer) {
  ModbusBench bench({}, true);
  ModbusSupervisor supervisor(bench.address(), test::kQuickTiming, kQuick);
  ASSERT_TRUE(test::comes([&] { return fresh(supervisor); })) << supervisor.trouble();
  EXPECT_TRUE(supervisor.request(SupervisorCommand::enable).accepted);
  EXPECT_EQ(bench.node().state(), NodeState::operation_enabled);
  EXPECT_TRUE(supervisor.request(SupervisorCommand::disable).accepted);
  EXPECT_EQ(bench.node().state(), NodeState::switch_on_disabled);
  bench.node().fail(FaultCause::bus_off);
  const SupervisorReply refused = supervisor.request(SupervisorCommand::enable);
  EXPECT_FALSE(refused.accepted);
  EXPECT_THAT(refused.message, HasSubstr("refused in state fault (the bus is off)"));
  EXPECT_TRUE(supervisor.request(SupervisorCommand::reset_fault).accepted);
  EXPECT_EQ(bench.node().state(), NodeState::switch_on_disabled);
}

TEST(ModbusSupervisor, ConnectsAgainWhenTheServerIsBack) {
  ModbusBench bench;
  const ModbusAddress address = bench.address();
  ModbusSupervisor supervisor(address, test::kQuickTiming, kQuick);
  ASSERT_TRUE(test::comes([&] { return fresh(supervisor); }));
  bench.stop();
  ASSERT_TRUE(test::comes([&] { return !supervisor.trouble().empty(); }));
  EXPECT_FALSE(supervisor.request(SupervisorCommand::enable).accepted);
  bench.restart(address.port);
  EXPECT_TRUE(test::comes([&] { return fresh(supervisor); })) << supervisor.trouble();
  EXPECT_TRUE(supervisor.request(SupervisorCommand::enable).accepted);
}

TEST(ModbusSupervisor, AnotherDeviceOrMapIsNamed) {
  // The status must be readable before its magic can be wrong.
  struct Zeros final : test::NoRegisters {
    ModbusException read(int first, std::span<std::uint16_t> values) override {
      std::fill(values.begin(), values.end(), std::uint16_t{0});
      if (version == 0 || first != modbus_map::kMagic || values.size() < 4) return {};
      const RegisterBlock out(first, values);
      out.set_u32(modbus_map::kMagic, modbus_map::kMagicValue);
      out.set_u32(modbus_map::kVersion, version);
      return ModbusException::none;
    }
    std::uint32_t version = 0;
  };
  for (const std::uint32_t version : {0U, 1U}) {
    Zeros registers;
    registers.version = version;
    const test::ServerThread server(registers, nullptr);
    const ModbusSupervisor supervisor(server.address(), test::kQuickTiming, kQuick);
    const char* wanted =
        version == 0 ? "check the unit" : "different protocol version (register map 1; expected 2)";
    EXPECT_TRUE(test::comes([&] { return supervisor.trouble().find(wanted) != std::string::npos; }))
        << supervisor.trouble();
    EXPECT_EQ(supervisor.snapshot().t_ns, 0);
  }
}

TEST(ModbusSupervisor, ANodeNoticesThatItsSupervisorIsGone) {
  ModbusBench bench({}, false, 0.1);
  {
    ModbusSupervisor supervisor(bench.address(), test::kQuickTiming, kQuick);
    ASSERT_TRUE(supervisor.request(SupervisorCommand::enable).accepted) << supervisor.trouble();
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    EXPECT_EQ(bench.node().state(), NodeState::operation_enabled) << "while it counts";
  }
  EXPECT_TRUE(test::comes([&] { return bench.node().state() == NodeState::fault; }));
  EXPECT_EQ(bench.node().cause(), FaultCause::host_heartbeat);
}

TEST(ModbusSupervisor, TimesThatMakeNoSenseAreRefused) {
  EXPECT_THROW(ModbusSupervisor({}, {}, {0.0, 0.1, 5.0}), std::invalid_argument);
  EXPECT_THROW(ModbusSupervisor({}, {}, {0.1, 0.0, 5.0}), std::invalid_argument);
  EXPECT_THROW(ModbusSupervisor({}, {}, {0.1, 6.0, 5.0}), std::invalid_argument);
}

}  // namespace stageid::test_modbus_supervisor
