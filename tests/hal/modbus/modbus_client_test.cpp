#include "hal/modbus/modbus_client.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

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

TEST_P(ModbusWire, AfterADrainALateReplyIsNotTakenForTheNextAnswer) {
  serve({"late_reply:0.6"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::timeout);
  EXPECT_THAT(link_->describe(link_->last()), HasSubstr("no reply within 0.4 s"));
  link_->drain();
  EXPECT_EQ(read(10, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{10, 11}));
}

TEST_P(ModbusWire, HalfAReplyIsNone) {
  serve({"half_frame"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::timeout);
  link_->drain();
  EXPECT_EQ(read(10, values), LinkStatus::ok);
  EXPECT_EQ(values, (Pair{10, 11}));
}

TEST_P(ModbusWire, ARefusalIsNamed) {
  serve({"exception:6"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::refused);
  EXPECT_THAT(link_->describe(link_->last()), HasSubstr("busy"));
  EXPECT_EQ(read(500, values), LinkStatus::refused);
  EXPECT_THAT(link_->describe(link_->last()), HasSubstr("Illegal data address"));
}

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

TEST_P(ModbusRtuWire, AnotherUnitsReplyIsCorrupt) {
  serve({"wrong_unit"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::corrupt);
}

TEST(ModbusClient, ADeadServerIsDisconnected) {
  test::NumberedRegisters registers;
  ModbusFaultScript script(test::modbus_faults({"dead_server@2"}));
  const test::ServerThread server(registers, &script);
  ModbusClient link(server.address(), test::kQuickTiming);
  Pair values{};
  EXPECT_EQ(link.read(0, values), LinkStatus::disconnected) << "not connected yet";
  link.connect();
  EXPECT_EQ(link.read(0, values), LinkStatus::ok);
  EXPECT_EQ(link.read(0, values), LinkStatus::disconnected);
  EXPECT_FALSE(link.connected());
  EXPECT_THROW(link.connect(), StageError);
}

// A device that never stops sending keeps every buffer full.
TEST(ModbusClient, AFloodEndsTheConnection) {
  const int listener = ::socket(AF_INET, SOCK_STREAM, 0);
  ASSERT_EQ(::listen(listener, 1), 0);  // on any free port
  sockaddr_in name{};
  socklen_t size = sizeof name;
  ::getsockname(listener, reinterpret_cast<sockaddr*>(&name), &size);
  std::thread flood([listener] {
    const int peer = ::accept(listener, nullptr, nullptr);
    char request = 0;  // earlier garbage would end the connection before it is used
    ::recv(peer, &request, 1, 0);
    const std::vector<char> garbage(1 << 20);
    while (::send(peer, garbage.data(), garbage.size(), MSG_NOSIGNAL) > 0) {
    }
    ::close(peer);
  });
  ModbusAddress address;
  address.port = ntohs(name.sin_port);
  ModbusClient link(address, test::kQuickTiming);
  link.connect();
  Pair values{};
  EXPECT_EQ(link.read(0, values), LinkStatus::corrupt);
  link.drain();
  EXPECT_FALSE(link.connected());
  EXPECT_EQ(link.read(0, values), LinkStatus::flooded);
  EXPECT_THAT(link.describe(link.last()), HasSubstr("sends more than it is asked for"));
  link.close();
  flood.join();
  ::close(listener);
}

TEST(ModbusClient, AddressesAndTimesThatMakeNoSenseAreRefused) {
  const auto with = [](auto change) {
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
