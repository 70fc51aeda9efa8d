// Ownership of the stage behind Modbus: second hosts, forged and random requests.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

#include "hal/modbus/modbus_encoding.hpp"
#include "hal/modbus/modbus_map.hpp"
#include "hal/modbus/modbus_stage.hpp"
#include "tests/hal/modbus/modbus_bench.hpp"
#include "tests/hal/modbus/numbered_registers.hpp"

namespace stageid::test_modbus_ownership {

namespace map = modbus_map;
using test::ModbusBench;
using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

constexpr ModbusConnection kOwner = 1;
constexpr ModbusConnection kOther = 2;

/// The registers of a node without a server: requests are made one by one.
struct Registers : testing::Test {
  Registers() : bench_(std::make_unique<ModbusBench>()) { bench_->stop(); }

  ModbusException write(ModbusConnection from, int first, const std::vector<std::uint32_t>& pairs) {
    std::vector<std::uint16_t> words(2 * pairs.size());
    for (std::size_t i = 0; i < pairs.size(); ++i)
      RegisterBlock(0, words).set_u32(2 * static_cast<int>(i), pairs[i]);
    bench_->registers().begin_request(from);
    return bench_->registers().write(first, words);
  }
  std::uint32_t read(ModbusConnection from, int address) {
    std::array<std::uint16_t, 2> words{};
    bench_->registers().begin_request(from);
    EXPECT_EQ(bench_->registers().read(address, words), ModbusException::none);
    return RegisterBlock(0, words).u32(0);
  }
  /// Everything that is visible to a client, except the owner.
  std::vector<std::uint16_t> image() {
    std::vector<std::uint16_t> words(map::kEnd);
    bench_->registers().begin_request(kOwner);
    EXPECT_EQ(bench_->registers().read(0, words), ModbusException::none);
    return words;
  }
  void begin() {
    ASSERT_TRUE(bench_->node().request(SupervisorCommand::enable).accepted);
    ASSERT_EQ(command(kOwner, map::kRunBegin, 11), ModbusException::none);
    session_ = read(kOwner, map::kSession);
    ASSERT_NE(session_, 0U);
  }
  ModbusException command(ModbusConnection from, std::uint32_t command, std::uint32_t sequence,
                          std::uint32_t key = 0) {
    return write(from, map::kRunCommand, {command, sequence, 0, sequence, key});  // the seed: any
  }
  ModbusException move(ModbusConnection from, std::uint32_t key, std::uint32_t sequence) {
    return write(from, map::kRunKey, {key, sequence, 1000, 0});
  }
  std::size_t moved() const { return bench_->fake->commands.size(); }

  std::unique_ptr<ModbusBench> bench_;
  std::uint32_t session_ = 0;
};

TEST_F(Registers, OnlyTheOwnersConnectionAndKeyMoveTheStage) {
  begin();
  EXPECT_EQ(move(kOwner, session_, 1), ModbusException::none);
  const std::vector<std::uint16_t> before = image();
  EXPECT_EQ(move(kOther, session_, 2), ModbusException::busy) << "the key, another connection";
  EXPECT_EQ(move(kOwner, session_ + 1, 2), ModbusException::busy) << "another key";
  EXPECT_EQ(write(kOther, map::kSetpoint, {5}), ModbusException::busy);
  EXPECT_EQ(command(kOther, map::kRunEnd, 12, session_), ModbusException::busy);
  EXPECT_EQ(command(kOwner, map::kRunEnd, 12, session_ + 1), ModbusException::busy);
  EXPECT_EQ(command(kOther, map::kRunBegin, 13), ModbusException::busy);
  EXPECT_EQ(command(kOwner, map::kRunBegin, 13, session_), ModbusException::busy);
  EXPECT_EQ(image(), before) << "a refused request has changed something";
  EXPECT_EQ(moved(), 1U);
  EXPECT_EQ(move(kOwner, session_, 2), ModbusException::none);
  EXPECT_EQ(moved(), 2U);
}

TEST_F(Registers, TheKeyIsShownToItsOwnerOnly) {
  begin();
  EXPECT_EQ(move(kOwner, session_, 1), ModbusException::none);
  EXPECT_EQ(read(kOther, map::kSession), 0U);
  EXPECT_EQ(read(kOther, map::kRunKey), 0U) << "as it was written";
  EXPECT_EQ(read(kOwner, map::kSession), session_);
}

TEST_F(Registers, TheSameBeginAgainIsAnsweredAndEveryRunHasItsKey) {
  begin();
  EXPECT_EQ(command(kOwner, map::kRunBegin, 11), ModbusException::none);
  EXPECT_EQ(read(kOwner, map::kSession), session_);
  EXPECT_EQ(move(kOwner, session_, 1), ModbusException::none);
  EXPECT_EQ(command(kOwner, map::kRunEnd, 12, session_), ModbusException::none);
  EXPECT_EQ(command(kOther, map::kRunBegin, 13), ModbusException::none);
  const std::uint32_t next = read(kOther, map::kSession);
  EXPECT_NE(next, session_);
  EXPECT_EQ(move(kOwner, session_, 1), ModbusException::busy) << "its run is over";
  EXPECT_EQ(move(kOther, next, 1), ModbusException::none);
}

TEST_F(Registers, ARunThatDoesNotBeginChangesNothing) {
  const std::vector<std::uint16_t> before = image();
  EXPECT_EQ(command(kOwner, map::kRunBegin, 11), ModbusException::device_failure) << "not enabled";
  EXPECT_EQ(command(kOwner, map::kRunEnd, 11), ModbusException::busy);
  EXPECT_EQ(move(kOwner, 0, 1), ModbusException::busy);
  EXPECT_EQ(image(), before);
}

TEST_F(Registers, TheHeartbeatIsCountedByOneConnection) {
  begin();
  EXPECT_EQ(write(kOwner, map::kHeartbeat, {1}), ModbusException::none);
  EXPECT_EQ(write(kOther, map::kHeartbeat, {2}), ModbusException::busy);
  EXPECT_EQ(read(kOther, map::kHeartbeatEcho), 1U);
  EXPECT_TRUE(bench_->registers().needs(kOwner));
  EXPECT_FALSE(bench_->registers().needs(kOther));
  bench_->registers().hung_up(kOwner);
  EXPECT_EQ(write(kOther, map::kHeartbeat, {2}), ModbusException::none);
}

TEST_F(Registers, TheRunOfAnotherDoorIsLeftAlone) {
  begin();
  ModbusNode other_door(bench_->node(), test::small_limits(), 5, nullptr);
  const auto give = [&](int first, const std::vector<std::uint16_t>& words) {
    other_door.begin_request(kOwner);
    return other_door.write(first, words);
  };
  EXPECT_EQ(give(map::kRunCommand, {0, 2, 0, 9, 0, 0, 0, 0, 0, 0}), ModbusException::busy);
  EXPECT_EQ(give(map::kRunCommand, {0, 1, 0, 9, 0, 0, 0, 0, 0, 0}), ModbusException::busy);
  EXPECT_EQ(give(map::kRunKey, {0, 0, 0, 1, 0, 5}), ModbusException::busy);
  EXPECT_EQ(bench_->node().state(), NodeState::measuring);
  EXPECT_EQ(moved(), 0U);
}

// Each request as a server would receive it from other clients; in between, the owner continues.
TEST_F(Registers, ForgedAndRandomRequestsOfOthersChangeNoSample) {
  begin();
  std::mt19937 engine(5);
  std::uint32_t sequence = 0;
  std::array<std::uint8_t, kLargestPdu> reply{};
  const auto word = [](Bytes& bytes, std::uint32_t value) {
    bytes.push_back(static_cast<std::uint8_t>(value >> 8));
    bytes.push_back(static_cast<std::uint8_t>(value));
  };
  const auto forged = [&] {  // a function 23 to some registers of the run, often with its key
    constexpr int kFirst[] = {map::kRunCommand, map::kRunKey, map::kSetpointSequence};
    const auto first = static_cast<std::uint32_t>(kFirst[engine() % 3]);
    Bytes pdu = {23};
    for (const std::uint32_t value : {300U, 10U, first, 10U}) word(pdu, value);
    pdu.push_back(20);
    for (int i = 0; i < 5; ++i) {
      const std::uint32_t values[] = {1, 2, session_, sequence + 1,
                                      static_cast<std::uint32_t>(engine())};
      const std::uint32_t value = values[engine() % 5];
      word(pdu, value >> 16);
      word(pdu, value);
    }
    return pdu;
  };
  const auto random = [&] {
    Bytes pdu(1 + engine() % 60);
    for (std::uint8_t& byte : pdu) byte = static_cast<std::uint8_t>(engine());
    constexpr std::uint8_t kFunctions[] = {3, 4, 6, 16, 23};
    pdu[0] = kFunctions[engine() % 5];
    if (pdu.size() > 9 && engine() % 2 == 0) {  // consistent lengths, low addresses
      pdu[1] = pdu[3] = pdu[5] = pdu[7] = 0;
      if (pdu[0] == 16) pdu[1] = 0, pdu[4] = static_cast<std::uint8_t>((pdu.size() - 6) / 2);
    }
    // Supervisor commands do not belong to the run: any client may send a quick stop.
    const bool writes = pdu[0] == 6 || pdu[0] == 16 || pdu[0] == 23;
    if (writes && pdu.size() > 6) pdu[pdu[0] == 23 ? 6 : 2] |= 16U;
    return pdu;
  };
  for (int round = 0; round < 1000; ++round) {
    for (int i = 0; i < 10; ++i)
      static_cast<void>(answer_request(forged(), kOther, bench_->registers(), reply));
    for (int i = 0; i < 100; ++i)
      static_cast<void>(answer_request(random(), kOther, bench_->registers(), reply));
    ASSERT_EQ(move(kOwner, session_, ++sequence), ModbusException::none);
    ASSERT_EQ(read(kOwner, map::kMeasurementStatus), 5U << 8) << round;
    ASSERT_EQ(moved(), sequence);
    ASSERT_EQ(bench_->fake->commands.back()[0], 1000 * 0x1p-26);
  }
  EXPECT_EQ(command(kOwner, map::kRunEnd, 77, session_), ModbusException::none);
  EXPECT_EQ(bench_->node().state(), NodeState::operation_enabled);
}

TEST(ModbusOwnership, ANodeThatWasRestartedIsNamedThoughItRefuses) {
  ModbusBench before;
  before.stop();
  ModbusBench after;
  after.stop();
  ModbusNode restarted(after.node(), test::small_limits(), ModbusBench::kBootId + 1, nullptr);
  test::RegistersThrough line(before.registers());  // several nodes in turn on one line
  const test::ServerThread server(line, nullptr, true);
  test::ModbusHost host(server.address());
  host.start();
  line.inner = &restarted;
  EXPECT_EQ(host.exchange(1.0, 1.0), Outcome::fault);
  EXPECT_THAT(host.stage.trouble(), HasSubstr("the node was restarted"));
}

TEST(ModbusOwnership, ASecondHostIsRefusedAndTheFirstNoticesNothing) {
  ModbusBench bench;
  test::ModbusHost first(bench.address());
  test::ModbusHost second(bench.address());
  first.start();
  for (int n = 0; n < 100; ++n) {
    if (n == 50) {
      EXPECT_THAT([&] { second.start(); }, test::refuses("another host measures with this stage"));
      second.stage.stop();
    }
    ASSERT_EQ(first.exchange(1.0, 1.0), Outcome::ok) << n << first.stage.trouble();
  }
  first.stage.stop();
  EXPECT_EQ(bench.node().state(), NodeState::switch_on_disabled);
  bench.stop();
  EXPECT_EQ(bench.fake->commands.size(), 100U);
}

}  // namespace stageid::test_modbus_ownership
