#include "hal/stage/peer_status.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "hal/modbus/modbus_encoding.hpp"
#include "hal/modbus/modbus_map.hpp"
#include "hal/modbus/modbus_stage.hpp"
#include "tests/hal/can/altered_can.hpp"
#include "tests/hal/can/can_host.hpp"
#include "tests/hal/modbus/modbus_bench.hpp"
#include "tests/hal/modbus/numbered_registers.hpp"
#include "tests/support/process/docs_table.hpp"

namespace stageid::test_peer_status {

namespace map = modbus_map;
using test::CanRig;
using test::reseal;

TEST(PeerStatus, HasOneMeaningEach) {
  std::size_t number = 0;
  for (const PeerMeaning& row : peer_meanings()) {
    EXPECT_EQ(static_cast<std::size_t>(row.status), number++);
    EXPECT_EQ(&meaning(row.status), &row);
    EXPECT_EQ(row.outcome == Outcome::ok, row.reaction == PeerReaction::use) << row.words;
  }
  EXPECT_EQ(number, static_cast<std::size_t>(PeerStatus::other_stage) + 1);
}

TEST(PeerStatus, TheDocsHaveTheTable) {
  const auto rows = test::table_in_docs("stops.md", "| status | over CAN FD |");
  ASSERT_EQ(rows.size(), peer_meanings().size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const PeerMeaning& m = peer_meanings()[i];
    EXPECT_EQ(rows[i][0], m.words);
    EXPECT_EQ(rows[i][3], to_string(m.reaction)) << m.words;
    EXPECT_EQ(rows[i][4], m.reaction == PeerReaction::refuse ? "-" : to_string(m.outcome));
  }
}

TEST(PeerStatus, CodesOfOutcomesMeanThemselvesOrAFault) {
  for (int code = 0; code <= 255; ++code)
    EXPECT_EQ(outcome_of_code(static_cast<std::uint8_t>(code)),
              code <= 9 ? static_cast<Outcome>(code) : Outcome::fault);
}

/// The node's report in the third sample and the host's reaction.
template <typename Node>
struct Row {
  PeerStatus status;
  std::function<void(Node&)> say;
  bool before_the_run = false;
};

template <typename Node>
std::string name_of(const testing::TestParamInfo<Row<Node>>& row) {
  return test::test_name(meaning(row.param.status).words) + std::to_string(row.index);
}

/// A frame of the node, and its bus.
struct CanSaid {
  CanFrame* frame;
  std::vector<CanFrame>* more;
  const CanState* last;

  bool measurement() const { return frame->id == kCanSensorId; }
  void state(const std::function<void(CanState&)>& change) const {
    CanState state = *last;
    state.answer = CanAnswer::none;
    state.session = 0;
    change(state);
    more->push_back(encode_can_state(state));
  }
};
using CanRow = Row<CanSaid>;

/// A byte of the measurement.
std::function<void(CanSaid&)> byte(std::size_t at, std::uint8_t value) {
  return [=](CanSaid& said) {
    if (said.measurement()) said.frame->data[at] = value;
    reseal(*said.frame);
  };
}

std::function<void(CanSaid&)> with_state(std::function<void(CanState&)> change) {
  return [change = std::move(change)](CanSaid& said) {
    if (said.measurement()) said.state(change);
  };
}

void no_value(CanSaid& said) {
  if (!said.measurement()) return;
  put_can_value(*said.frame, kCanHeaderBytes, NAN, {1.0});
  reseal(*said.frame);
}

std::function<void(CanSaid&)> every_state(std::function<void(CanState&)> change) {
  return [change = std::move(change)](CanSaid& said) {
    CanState state;
    if (said.frame->id != kCanStateId || !decode_can_state(*said.frame, state)) return;
    change(state);
    *said.frame = encode_can_state(state);
  };
}

class CanPeer : public testing::TestWithParam<CanRow> {};

TEST_P(CanPeer, HasTheReactionOfTheTable) {
  const CanRow& row = GetParam();
  const PeerMeaning& wanted = meaning(row.status);
  CanRig rig;
  bool say = row.before_the_run;
  CanState last;
  const auto alter = [&](std::span<CanFrame> frames, std::size_t count) {
    std::vector<CanFrame> more;
    for (std::size_t i = 0; i < count; ++i) {
      CanState state;
      if (frames[i].id == kCanStateId && decode_can_state(frames[i], state)) last = state;
      CanSaid said{&frames[i], &more, &last};
      if (say) row.say(said);
    }
    for (const CanFrame& frame : more) frames[count++] = frame;
    return count;
  };
  const auto bus = rig.host_bus();
  CanStage stage(rig.stage_spec().info, rig.spec(), std::make_unique<test::AlteredCan>(*bus, alter),
                 {1e3, false});
  test::Driver host(stage);
  host.u.assign(2, 0.1);
  if (row.before_the_run) {
    EXPECT_THAT([&] { host.start(); }, test::refuses(wanted.words));
    EXPECT_NE(rig.node().state(), NodeState::measuring);
    return;
  }
  host.start();
  const auto exchange = [&] {
    const Outcome outcome = host.step();
    rig.pair().pass_time(1'000'000);
    return outcome == Outcome::late ? Outcome::ok : outcome;  // of a busy machine
  };
  for (int cycle = 0; cycle < 2; ++cycle) ASSERT_EQ(exchange(), Outcome::ok);
  say = true;
  const Outcome outcome = host.step();
  say = false;
  EXPECT_EQ(outcome, wanted.outcome) << stage.trouble();
  if (wanted.reaction == PeerReaction::mark) {
    EXPECT_EQ(exchange(), Outcome::ok);
  } else {
    EXPECT_THAT(stage.trouble(), testing::Not(testing::IsEmpty()));
    // At a limit the excitation is ramped down; the node may be good again meanwhile.
    if (wanted.outcome == Outcome::limit) static_cast<void>(exchange());
    EXPECT_THAT(stage.trouble(), testing::Not(testing::IsEmpty()));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Rows, CanPeer,
    testing::Values(
        CanRow{PeerStatus::setpoints_missed, with_state([](CanState& s) { s.gaps = 5; })},
        CanRow{PeerStatus::nothing_new, no_value},
        CanRow{PeerStatus::damaged, [](CanSaid& s) { s.frame->data[9] ^= 1U; }},
        CanRow{PeerStatus::out_of_range,
               byte(2, kCanSaturatedBit | static_cast<std::uint8_t>(NodeState::measuring))},
        CanRow{PeerStatus::limit, with_state([](CanState& s) {
                 s.state = NodeState::fault_reaction;
                 s.cause = FaultCause::limit;
               })},
        CanRow{PeerStatus::not_measuring,
               byte(2, static_cast<std::uint8_t>(NodeState::operation_enabled))},
        CanRow{PeerStatus::not_measuring,
               with_state([](CanState& s) { s.state = NodeState::quick_stop; })},
        CanRow{PeerStatus::not_measuring,
               with_state([](CanState& s) { s.run = static_cast<std::uint8_t>(s.run + 1); })},
        CanRow{PeerStatus::fault, with_state([](CanState& s) {
                 s.state = NodeState::fault;
                 s.cause = FaultCause::temperature;
               })},
        CanRow{PeerStatus::fault,
               with_state([](CanState& s) { s.cause = static_cast<FaultCause>(77); })},
        CanRow{PeerStatus::unknown_code, byte(2, 9)},
        CanRow{PeerStatus::unknown_code,
               with_state([](CanState& s) { s.state = static_cast<NodeState>(42); })},
        CanRow{PeerStatus::conflict,
               [](CanSaid& s) {
                 if (!s.measurement()) return;
                 CanFrame other = *s.frame;
                 std::swap(other, *s.frame);
                 s.frame->data[8] ^= 0x10U;
                 reseal(*s.frame);
                 s.more->push_back(other);
               }},
        CanRow{PeerStatus::other_node, with_state([](CanState& s) { s.boot ^= 8U; })},
        CanRow{PeerStatus::first_sample_missing, no_value, true},
        CanRow{PeerStatus::in_fault, every_state([](CanState& s) { s.state = NodeState::fault; }),
               true},
        CanRow{PeerStatus::two_nodes,
               [](CanSaid& s) {
                 if (s.frame->id == kCanStateId) s.state([](CanState& told) { told.boot ^= 8U; });
               },
               true},
        CanRow{PeerStatus::other_version, every_state([](CanState& s) { s.version = 1; }), true},
        CanRow{PeerStatus::other_stage, every_state([](CanState& s) { s.fingerprint ^= 1U; }),
               true}),
    name_of<CanSaid>);

/// The registers of a node, changed before they are sent.
class LyingRegisters final : public test::RegistersThrough {
 public:
  using RegistersThrough::RegistersThrough;
  ModbusException read(int first, std::span<std::uint16_t> values) override {
    const ModbusException refused = RegistersThrough::read(first, values);
    first_ = first;
    values_ = values;
    if (say && (first == map::kMeasurementBootId || always)) say(*this);
    return refused;
  }
  void set(int address, std::uint32_t value) {
    if (address < first_ || address + 2 > first_ + static_cast<int>(values_.size())) return;
    RegisterBlock(first_, values_).set_u32(address, value);
  }
  std::function<void(LyingRegisters&)> say;
  bool always = false;

 private:
  int first_ = 0;
  std::span<std::uint16_t> values_;
};

/// Outcome, state and cause of the measurement status.
std::function<void(LyingRegisters&)> status(unsigned outcome, unsigned state = 5,
                                            unsigned cause = 0, unsigned missed = 0) {
  return [=](LyingRegisters& r) {
    r.set(map::kMeasurementStatus, outcome | state << 8 | cause << 16 | missed << 24);
  };
}

using ModbusRow = Row<LyingRegisters>;

class ModbusPeer : public testing::TestWithParam<ModbusRow> {};

TEST_P(ModbusPeer, HasTheReactionOfTheTable) {
  const ModbusRow& row = GetParam();
  const PeerMeaning& wanted = meaning(row.status);
  test::ModbusBench bench;
  LyingRegisters lying(bench.registers());
  bench.stop();
  const test::ServerThread server(lying, nullptr);
  lying.always = row.before_the_run;
  if (row.before_the_run) lying.say = row.say;
  test::ModbusHost host(server.address());
  if (row.before_the_run) {
    EXPECT_THAT([&] { host.start(); }, test::refuses(wanted.words));
    EXPECT_NE(bench.node().state(), NodeState::measuring);
    return;
  }
  host.start();
  ASSERT_EQ(host.exchange(0.1, 0.1), Outcome::ok);
  lying.say = row.say;
  EXPECT_EQ(host.exchange(0.1, 0.1), wanted.outcome) << host.stage.trouble();
  const std::string trouble = host.stage.trouble();
  EXPECT_THAT(trouble, testing::Not(testing::IsEmpty()));
  if (wanted.outcome != Outcome::limit) return;
  // The excitation is ramped down; the node may be good again meanwhile.
  lying.say = nullptr;
  EXPECT_EQ(host.exchange(0.1, 0.1), Outcome::ok);
  EXPECT_EQ(host.stage.trouble(), trouble);
}

INSTANTIATE_TEST_SUITE_P(
    Rows, ModbusPeer,
    testing::Values(
        ModbusRow{PeerStatus::setpoints_missed, status(0, 5, 0, 1)},
        ModbusRow{PeerStatus::late, status(1)}, ModbusRow{PeerStatus::passive, status(5)},
        ModbusRow{PeerStatus::incomplete, status(2)}, ModbusRow{PeerStatus::nothing_new, status(3)},
        ModbusRow{PeerStatus::nothing_new, [](LyingRegisters& r) { r.set(map::kValid + 2, 0); }},
        ModbusRow{PeerStatus::damaged, status(4)},
        ModbusRow{PeerStatus::out_of_range,
                  [](LyingRegisters& r) { r.set(map::kMeasurement, 0x7FFFFFFFU); }},
        ModbusRow{PeerStatus::limit, status(9)}, ModbusRow{PeerStatus::limit, status(0, 7, 2)},
        ModbusRow{PeerStatus::not_measuring, status(0, 4)}, ModbusRow{PeerStatus::fault, status(8)},
        ModbusRow{PeerStatus::fault, status(0, 8, 7)},
        ModbusRow{PeerStatus::fault, status(0, 5, 4)},
        ModbusRow{PeerStatus::unknown_code, status(10)},
        ModbusRow{PeerStatus::unknown_code, status(0, 9)},
        ModbusRow{PeerStatus::bus_off, status(6)}, ModbusRow{PeerStatus::link_down, status(7)},
        ModbusRow{PeerStatus::other_node,
                  [](LyingRegisters& r) { r.set(map::kMeasurementBootId, 9); }},
        ModbusRow{PeerStatus::first_sample_missing,
                  [](LyingRegisters& r) { r.set(map::kValid + 2, 0); }, true},
        ModbusRow{PeerStatus::in_fault, [](LyingRegisters& r) { r.set(map::kState, 8); }, true},
        ModbusRow{PeerStatus::other_version, [](LyingRegisters& r) { r.set(map::kVersion, 1); },
                  true},
        ModbusRow{PeerStatus::other_stage, [](LyingRegisters& r) { r.set(map::kChannelHash, 1); },
                  true}),
    name_of<LyingRegisters>);

// can_ownership_test.cpp and modbus_ownership_test.cpp test the rows that need more than one peer. can_stage_test.cpp
// and can_fault_test.cpp test those of a bus, modbus_stage_test.cpp those of a link.

}  // namespace stageid::test_peer_status
