#include "hal/modbus_link.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <random>
#include <thread>

#include "hal/stage.hpp"
#include "tests/hal/modbus_bench.hpp"
#include "tests/hal/numbered_registers.hpp"

namespace stageid {
namespace {

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

// What drain() is there for: RTU replies have no number.
TEST_P(ModbusRtuLink, WithoutADrainTheLateReplyWouldBeTakenForTheNextAnswer) {
  serve({"late_reply:0.6"});
  Pair values{};
  EXPECT_EQ(read(0, values), LinkStatus::timeout);
  std::this_thread::sleep_for(std::chrono::seconds(2));  // a pty of a busy machine takes its time
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

TEST(ModbusServer, APortThatIsTakenIsRefused) {
  test::NumberedRegisters registers;
  const test::ServerThread server(registers, nullptr);
  EXPECT_THROW(ModbusServer(server.address(), registers, nullptr), StageError);
  ModbusAddress serial;
  serial.device = "/dev/there-is-none";
  EXPECT_THROW(ModbusServer(serial, registers, nullptr), StageError);
}

int raw_client(int port) {
  const int client = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in name{};
  name.sin_family = AF_INET;
  name.sin_port = htons(static_cast<std::uint16_t>(port));
  name.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(client, reinterpret_cast<sockaddr*>(&name), sizeof name), 0);
  return client;
}

TEST(ModbusServer, GarbageOfOneClientDoesNotDisturbAnother) {
  test::NumberedRegisters registers;
  const test::ServerThread server(registers, nullptr);
  ModbusLink link(server.address(), test::kQuickTiming);
  link.connect();
  std::mt19937 engine(2);
  for (int round = 0; round < 50; ++round) {
    const int client = raw_client(server.address().port);
    std::array<std::uint8_t, 64> bytes{};
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(engine() & 0xFFU);
    // Every other time a header that looks sound, followed by a request cut off or made up.
    if (round % 2 == 0) std::fill_n(bytes.begin() + 2, 3, std::uint8_t{0});
    EXPECT_GT(send(client, bytes.data(), 7 + engine() % 57, MSG_NOSIGNAL), 0);
    Pair values{};
    EXPECT_EQ(link.read(20, values), LinkStatus::ok);
    EXPECT_EQ(values, (Pair{20, 21}));
    close(client);
  }
}

// A request cut off, then whole ones without a pause longer than the server's silence: a server that
// waits for the rest takes the next one's bytes for it.
TEST(ModbusServer, ASerialLineIsFoundAgainAfterHalfARequest) {
  test::NumberedRegisters registers;
  const test::ServerThread server(registers, nullptr, true);
  const int line = open(server.address().device.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  const std::array<std::uint8_t, 4> half = {1, 3, 0, 0};
  EXPECT_EQ(write(line, half.data(), half.size()), 4);
  ModbusLink link(server.address(), test::kQuickTiming);
  link.connect();
  Pair values{};
  LinkStatus status = link.read(20, values);
  for (int attempt = 0; status != LinkStatus::ok && attempt < 3; ++attempt) {
    link.drain();
    status = link.read(20, values);
  }
  EXPECT_EQ(status, LinkStatus::ok);
  EXPECT_EQ(values, (Pair{20, 21}));
  close(line);
}

}  // namespace
}  // namespace stageid
