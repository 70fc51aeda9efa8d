#include "hal/modbus/modbus_link.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <thread>

#include "hal/stage/stage.hpp"
#include "tests/hal/modbus/modbus_bench.hpp"
#include "tests/hal/modbus/numbered_registers.hpp"

namespace stageid {
namespace test_modbus_link {

using Pair = std::array<std::uint16_t, 2>;
using testing::HasSubstr;

/// TCP (false) and RTU (true).
class ModbusLinkTest : public testing::TestWithParam<bool> {
 protected:
  void serve(const std::vector<std::string>& faults) {
    script_ = ModbusFaultScript(test::modbus_faults(faults));
    server_ = std::make_unique<test::ServerThread>(registers_, &script_, GetParam());
    link_ = std::make_unique<ModbusLink>(server_->address(), test::kQuickTiming);
    link_->connect();
  }
  LinkStatus read(int first, Pair& registers) { return link_->read(first, registers); }

  test::NumberedRegisters registers_;
  ModbusFaultScript script_;
  std::unique_ptr<test::ServerThread> server_;
  std::unique_ptr<ModbusLink> link_;
};

TEST_P(ModbusLinkTest, WritesBeforeItReads) {
  serve({});
  Pair values{};
  EXPECT_EQ(read(40, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{40, 41}));
  EXPECT_EQ(link_->exchange(41, Pair{7, 8}, 40, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{40, 7}));
}

TEST_P(ModbusLinkTest, AfterADrainALateReplyIsNotTakenForTheNextAnswer) {
  serve({"late_reply:0.6"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::timeout);
  EXPECT_THAT(link_->describe(link_->last()), HasSubstr("no reply within 0.4 s"));
  link_->drain();
  EXPECT_EQ(read(10, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{10, 11}));
}

TEST_P(ModbusLinkTest, HalfAReplyIsNone) {
  serve({"half_frame"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::timeout);
  link_->drain();
  EXPECT_EQ(read(10, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{10, 11}));
}

TEST_P(ModbusLinkTest, ARefusalIsNamed) {
  serve({"exception:6"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::refused);
  EXPECT_THAT(link_->describe(link_->last()), HasSubstr("busy"));
  EXPECT_EQ(read(500, values), LinkStatus::refused);
  EXPECT_THAT(link_->describe(link_->last()), HasSubstr("Illegal data address"));
}

INSTANTIATE_TEST_SUITE_P(Wires, ModbusLinkTest, testing::Bool(),
                         [](const auto& wire) { return wire.param ? "Rtu" : "Tcp"; });

using ModbusRtuLink = ModbusLinkTest;
INSTANTIATE_TEST_SUITE_P(Wires, ModbusRtuLink, testing::Values(true));

// drain() is needed because RTU replies have no number.
TEST_P(ModbusRtuLink, WithoutADrainTheLateReplyWouldBeTakenForTheNextAnswer) {
  serve({"late_reply:0.6"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::timeout);
  std::this_thread::sleep_for(std::chrono::seconds(2));  // a pty is slow on a busy machine
  EXPECT_EQ(read(10, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{0, 1}));
}

TEST_P(ModbusRtuLink, AnotherUnitsReplyIsCorrupt) {
  serve({"wrong_unit"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::corrupt);
}

TEST(ModbusLink, ADeadServerIsDisconnected) {
  test::NumberedRegisters registers;
  ModbusFaultScript script(test::modbus_faults({"dead_server@2"}));
  const test::ServerThread server(registers, &script);
  ModbusLink link(server.address(), test::kQuickTiming);
  Pair values{};
  EXPECT_EQ(link.read(0, values), LinkStatus::disconnected) << "not connected yet";
  link.connect();
  EXPECT_EQ(link.read(0, values), LinkStatus::ok);
  EXPECT_EQ(link.read(0, values), LinkStatus::disconnected);
  EXPECT_FALSE(link.connected());
  EXPECT_THROW(link.connect(), StageError);
}

TEST(ModbusLink, AddressesAndTimesThatMakeNoSenseAreRefused) {
  const auto with = [](auto change) {
    ModbusAddress address;
    address.device = "/dev/null";
    change(address);
    return address;
  };
  EXPECT_THROW(ModbusLink(with([](auto& a) { a.unit = 248; }), {}), std::invalid_argument);
  EXPECT_THROW(ModbusLink(with([](auto& a) { a.baud = 12345; }), {}), std::invalid_argument);
  EXPECT_THROW(ModbusLink(with([](auto& a) { a.parity = 'X'; }), {}), std::invalid_argument);
  EXPECT_THROW(ModbusLink({}, {0.2, 0.1, 1e-3}), std::invalid_argument);
  EXPECT_THROW(ModbusLink({}, {0.0, 0.1, 1e-3}), std::invalid_argument);
  EXPECT_NO_THROW(ModbusLink({}, {0.2, 0.2, 1e-3}));
}

}  // namespace test_modbus_link
}  // namespace stageid
