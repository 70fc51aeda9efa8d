#include "hal/modbus/modbus_client.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <thread>
#include <vector>

#include "hal/stage/stage.hpp"
#include "tests/hal/modbus/modbus_bench.hpp"
#include "tests/hal/modbus/numbered_registers.hpp"

namespace stageid::test_modbus_client {

using Pair = std::array<std::uint16_t, 2>;
using testing::HasSubstr;

/// TCP (false) and RTU (true).
struct ModbusWire : testing::TestWithParam<bool> {
  void serve(const std::vector<std::string>& faults) {
    script_ = ModbusFaultScript(test::modbus_faults(faults));
    server_ = std::make_unique<test::ServerThread>(registers_, &script_, GetParam());
    link_ = std::make_unique<ModbusClient>(server_->address(), test::kQuickTiming);
    link_->connect();
  }
  LinkStatus read(int first, Pair& registers) { return link_->read(first, registers); }

  test::NumberedRegisters registers_;
  ModbusFaultScript script_;
  std::unique_ptr<test::ServerThread> server_;
  std::unique_ptr<ModbusClient> link_;
};

TEST_P(ModbusWire, WritesBeforeItReads) {
  serve({});
  Pair values{};
  EXPECT_EQ(read(40, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{40, 41}));
  EXPECT_EQ(link_->exchange(41, Pair{7, 8}, 40, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{40, 7}));
}

TEST_P(ModbusWire, ARefusalIsNamed) {
  serve({"exception:6"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::refused);
  EXPECT_THAT(link_->describe(link_->last()), HasSubstr("busy"));
  EXPECT_EQ(read(500, values), LinkStatus::refused);
  EXPECT_THAT(link_->describe(link_->last()), HasSubstr("Illegal data address"));
}

// modbus_stage_test.cpp has the faults of both wires, integration.modbus_fault_matrix a flood.
INSTANTIATE_TEST_SUITE_P(Wires, ModbusWire, testing::Bool(),
                         [](const auto& wire) { return wire.param ? "Rtu" : "Tcp"; });

using ModbusRtuWire = ModbusWire;
INSTANTIATE_TEST_SUITE_P(Wires, ModbusRtuWire, testing::Values(true));

// drain() is needed because RTU replies have no number.
TEST_P(ModbusRtuWire, WithoutADrainTheLateReplyWouldBeTakenForTheNextAnswer) {
  serve({"late_reply:0.6"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::timeout);
  std::this_thread::sleep_for(std::chrono::seconds(2));  // a pty is slow on a busy machine
  EXPECT_EQ(read(10, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{0, 1}));
}

TEST(ModbusClient, AddressesAndTimesThatMakeNoSenseAreRefused) {
  const auto with = [](void (*change)(ModbusAddress&)) {
    ModbusAddress address;
    address.device = "/dev/null";
    change(address);
    return address;
  };
  EXPECT_THROW(ModbusClient(with([](auto& a) { a.unit = 248; }), {}), std::invalid_argument);
  EXPECT_THROW(ModbusClient(with([](auto& a) { a.baud = 12345; }), {}), std::invalid_argument);
  EXPECT_THROW(ModbusClient(with([](auto& a) { a.parity = 'X'; }), {}), std::invalid_argument);
  EXPECT_THROW(ModbusClient({}, {0.2, 0.1, 1e-3}), std::invalid_argument);
  EXPECT_THROW(ModbusClient({}, {0.0, 0.1, 1e-3}), std::invalid_argument);
  EXPECT_NO_THROW(ModbusClient({}, {0.2, 0.2, 1e-3}));
}

}  // namespace stageid::test_modbus_client
