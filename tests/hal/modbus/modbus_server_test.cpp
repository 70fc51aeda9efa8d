// integration.modbus_peer_test has crowds of clients, integration.modbus_fault_matrix other units on a line.
#include "hal/modbus/modbus_server.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <random>

#include "hal/modbus/modbus_client.hpp"
#include "hal/modbus/modbus_request_frame.hpp"
#include "hal/stage/stage.hpp"
#include "tests/hal/modbus/modbus_bench.hpp"
#include "tests/hal/modbus/numbered_registers.hpp"

namespace stageid::test_modbus_server {

using Pair = std::array<std::uint16_t, 2>;
using Bytes = std::vector<std::uint8_t>;

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
  ModbusClient link(server.address(), test::kQuickTiming);
  link.connect();
  std::mt19937 engine(2);
  for (int round = 0; round < 50; ++round) {
    const int client = raw_client(server.address().port);
    std::array<std::uint8_t, 64> bytes{};
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(engine() & 0xFFU);
    // Every second time a plausible header, followed by a truncated or invented request.
    if (round % 2 == 0) std::fill_n(bytes.begin() + 2, 3, std::uint8_t{0});
    EXPECT_GT(send(client, bytes.data(), 7 + engine() % 57, MSG_NOSIGNAL), 0);
    Pair values{};
    EXPECT_EQ(link.read(20, values), LinkStatus::ok);
    EXPECT_EQ(values, (Pair{20, 21}));
    close(client);
  }
}

// A truncated request, then complete ones without a pause longer than the server's silence. A server that waits for the
// rest would take bytes of the next request for it.
TEST(ModbusServer, ASerialLineIsFoundAgainAfterHalfARequest) {
  test::NumberedRegisters registers;
  const test::ServerThread server(registers, nullptr, true);
  const int line = open(server.address().device.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  const std::array<std::uint8_t, 4> half = {1, 3, 0, 0};
  EXPECT_EQ(write(line, half.data(), half.size()), 4);
  ModbusClient link(server.address(), test::kQuickTiming);
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

/// Sockets that are closed by the destructor.
struct Clients {
  Clients() = default;
  ~Clients() {
    for (const int client : all) close(client);
  }
  Clients(Clients&&) = delete;
  int add(int port) { return all.emplace_back(raw_client(port)); }
  std::vector<int> all;
};

void write_to(int client, const Bytes& bytes) {
  EXPECT_EQ(send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL), std::ssize(bytes));
}

/// Waits until the server has ended this connection.
bool hung_up(int client) {
  std::uint8_t byte = 0;
  ssize_t count = 0;
  while ((count = recv(client, &byte, 1, 0)) > 0) {
  }
  return count == 0 || errno == ECONNRESET;
}

TEST(ModbusServer, ARequestThatIsNotCompletedEndsItsConnection) {
  test::NumberedRegisters registers;
  const test::ServerThread server(registers, nullptr);
  Clients clients;
  const int client = clients.add(server.address().port);
  write_to(client, {0, 1, 0, 0, 0});
  EXPECT_TRUE(hung_up(client));
}

TEST(ModbusServer, RepliesThatNobodyTakesEndTheConnection) {
  test::NumberedRegisters registers;
  const test::ServerThread server(registers, nullptr);
  Clients clients;
  const int client = clients.add(server.address().port);
  const int small = 1024;
  setsockopt(client, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
  const Bytes request = tcp_frame(1, 1, Bytes{3, 0, 0, 0, 100});
  ssize_t sent = 0;
  while (sent >= 0) sent = send(client, request.data(), request.size(), MSG_NOSIGNAL);
  EXPECT_TRUE(errno == EPIPE || errno == ECONNRESET) << errno;
}

TEST(ModbusServer, ANewClientGetsThePlaceThatIsIdleLongestButNotAnOwners) {
  struct Owned final : test::NoRegisters {
    void begin_request(ModbusConnection from) override {
      if (owner == 0) owner = from;
    }
    bool needs(ModbusConnection connection) const override { return connection == owner; }
    ModbusConnection owner = 0;
  };
  Owned registers;
  const test::ServerThread server(registers, nullptr);
  Clients clients;
  const auto ask = [&](int client) {
    write_to(client, tcp_frame(1, 1, Bytes{3, 0, 0, 0, 1}));
    std::array<std::uint8_t, 11> reply{};
    return recv(client, reply.data(), reply.size(), MSG_WAITALL) == 11;
  };
  for (std::size_t i = 0; i < ModbusServer::kMostClients; ++i)
    ASSERT_TRUE(ask(clients.add(server.address().port)));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(ask(clients.add(server.address().port)));
  EXPECT_TRUE(ask(clients.all[0])) << "the owner";
  for (std::size_t i = 1; i <= 3; ++i) EXPECT_TRUE(hung_up(clients.all[i])) << i;
  EXPECT_TRUE(ask(clients.all[4]));
}

}  // namespace stageid::test_modbus_server
