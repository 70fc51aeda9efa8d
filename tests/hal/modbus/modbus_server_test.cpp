#include "hal/modbus/modbus_server.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <random>

#include "hal/modbus/modbus_client.hpp"
#include "hal/modbus/modbus_map.hpp"
#include "hal/modbus/modbus_request_frame.hpp"
#include "hal/modbus/modbus_stage.hpp"
#include "hal/stage/stage.hpp"
#include "tests/hal/modbus/modbus_bench.hpp"
#include "tests/hal/modbus/numbered_registers.hpp"
#include "tests/support/process/resident_bytes.hpp"

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
  Clients() {
    rlimit files{};
    getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = std::min<rlim_t>(files.rlim_max, 4096);
    setrlimit(RLIMIT_NOFILE, &files);
  }
  ~Clients() {
    for (const int client : all) close(client);
  }
  Clients(Clients&&) = delete;
  /// Uses descriptors from 1024 on, because libmodbus needs the lower ones.
  int add(int port) {
    const int low = raw_client(port);
    const int client = fcntl(low, F_DUPFD_CLOEXEC, 1024);
    if (client < 0) return all.emplace_back(low);
    close(low);
    return all.emplace_back(client);
  }
  std::vector<int> all;
};

void write_to(int client, const Bytes& bytes) {
  static_cast<void>(send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT));
}

/// Whether the server has ended this connection; waits for it.
bool hung_up(int client, int flags = 0) {
  std::array<std::uint8_t, 4096> bytes{};
  ssize_t count = 0;
  while ((count = recv(client, bytes.data(), bytes.size(), flags)) > 0) {
  }
  return count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK);
}

const Bytes kReadRequest = tcp_frame(1, 1, Bytes{3, 0, 0, 0, 100});

// The owner's run, a supervisor with heartbeat, and other clients. The owner's exchanges are answered within its
// response time, the heartbeat is watched, and the run ends normally.
TEST(ModbusServer, AThousandIdleAndAHundredSlowClientsLockNobodyOut) {
  const std::size_t before = test::resident_bytes();
  test::ModbusBench bench;
  test::ModbusHost owner(bench.address());
  owner.start();
  const auto exchange = [&] { return owner.exchange(0.5, 0.5); };
  ASSERT_EQ(exchange(), Outcome::ok);

  Clients clients;
  const int port = bench.address().port;
  for (int i = 0; i < 1000; ++i) {
    clients.add(port);
    if (i % 20 != 0) continue;
    ASSERT_EQ(exchange(), Outcome::ok) << i << owner.stage.trouble();
  }
  for (int i = 0; i < 100; ++i) {
    const int client = clients.add(port);
    if (i % 2 == 0) {
      write_to(client, {0, 1, 0, 0, 0});  // half a header
    } else {
      for (int request = 0; request < 2000; ++request)  // without reading a reply
        write_to(client, kReadRequest);
    }
    if (i % 5 != 0) continue;
    ASSERT_EQ(exchange(), Outcome::ok) << i << owner.stage.trouble();
  }
  ModbusClient another(bench.address(), test::kQuickTiming);
  another.connect();
  Pair values{};
  EXPECT_EQ(another.read(modbus_map::kMagic, values), LinkStatus::ok);
  EXPECT_EQ(exchange(), Outcome::ok);
  std::size_t open = 0;
  for (const int client : clients.all) open += hung_up(client, MSG_DONTWAIT) ? 0U : 1U;
  EXPECT_LE(open, ModbusServer::kMostClients) << "places are bounded";
  EXPECT_LT(test::resident_bytes() - before, std::size_t{8} << 20);
  owner.stage.stop();
  EXPECT_EQ(bench.node().state(), NodeState::switch_on_disabled);
  bench.stop();
  EXPECT_EQ(bench.fake->commands.size(), owner.cycle);
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

// For any client, the registers are updated every few milliseconds, and the server ends.
TEST(ModbusServer, WatchesAndEndsWhileAClientStalls) {
  struct Ticking final : test::NoRegisters {
    void tick() override { ++ticks; }
    std::atomic<int> ticks = 0;
  };
  Ticking registers;
  Clients clients;
  {
    const test::ServerThread server(registers, nullptr);
    for (int i = 0; i < 8; ++i) {
      const int client = clients.add(server.address().port);
      for (int request = 0; request < 5000; ++request) write_to(client, kReadRequest);
    }
    const int before = registers.ticks;
    while (registers.ticks < before + 20) std::this_thread::yield();
  }
  for (const int client : clients.all) EXPECT_TRUE(hung_up(client));
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

// Requests and replies of other units without a pause: requests for this unit in between are found and answered.
TEST(ModbusServer, OtherUnitsOnASerialLineDoNotDeafenTheNode) {
  test::NumberedRegisters registers;
  const test::ServerThread server(registers, nullptr, true);
  const int line = open(server.address().device.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  ModbusClient link(server.address(), {3.0, 5.0, 1e-3});  // a pty takes its time
  link.connect();
  for (int round = 0; round < 20; ++round) {
    for (const Bytes& pdu :
         {Bytes{3, 0, 0, 0, 10},
          Bytes{3, 20, 1, 3, 1, 3, 0, 5, 1, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18},
          Bytes{3, 0, 0, 0, 1}, Bytes{3, 2, 0, 5}, Bytes{16, 0, 1, 0, 1, 2, 1, 3},
          Bytes{16, 0, 1, 0, 1}, Bytes{0x83, 2}, Bytes{23, 4, 1, 3, 0, 0}}) {
      const Bytes frame = rtu_frame(2, pdu);
      EXPECT_EQ(write(line, frame.data(), frame.size()), static_cast<ssize_t>(frame.size()));
    }
    Pair values{};
    ASSERT_EQ(link.read(20, values), LinkStatus::ok) << round;
    EXPECT_EQ(values, (Pair{20, 21}));
  }
  close(line);
}

}  // namespace stageid::test_modbus_server
