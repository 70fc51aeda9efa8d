// Ownership of the stage behind Modbus. integration.modbus_peer_test has second hosts and forged requests.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
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

}  // namespace stageid::test_modbus_ownership
