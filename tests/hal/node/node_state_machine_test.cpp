#include "hal/node/node_state_machine.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <set>
#include <string>

namespace stageid::test_node_state_machine {

using State = NodeState;
using Command = SupervisorCommand;

/// A machine brought to `state` in the way of a node.
NodeStateMachine machine_in(State state) {
  NodeStateMachine machine;
  if (state == State::not_ready) return machine;
  machine.self_test_passed();
  if (state == State::switch_on_disabled) return machine;
  EXPECT_TRUE(machine.request(Command::enable));
  if (state == State::operation_enabled) return machine;
  EXPECT_TRUE(machine.begin_measuring());
  if (state == State::quick_stop) static_cast<void>(machine.request(Command::quick_stop));
  if (state == State::fault_reaction || state == State::fault) machine.fail(FaultCause::watchdog);
  if (state == State::fault) machine.at_rest();
  EXPECT_EQ(machine.state(), state);
  return machine;
}

TEST(NodeStateMachine, EnableLeadsToOperationAndMeasuringBack) {
  NodeStateMachine machine;
  EXPECT_EQ(machine.state(), State::not_ready);
  machine.self_test_passed();
  EXPECT_EQ(machine.state(), State::switch_on_disabled);
  EXPECT_FALSE(machine.powered());
  EXPECT_TRUE(machine.request(Command::enable));
  EXPECT_EQ(machine.state(), State::operation_enabled);
  EXPECT_TRUE(machine.powered());
  EXPECT_TRUE(machine.begin_measuring());
  EXPECT_EQ(machine.state(), State::measuring);
  machine.end_measuring();
  EXPECT_EQ(machine.state(), State::operation_enabled);
  EXPECT_TRUE(machine.request(Command::disable));
  EXPECT_EQ(machine.state(), State::switch_on_disabled);
}

/// One row of the table: where the commands lead from a state. A refused command (nothing) changes nothing.
struct Row {
  State from;
  std::optional<State> enable, disable, quick_stop, reset_fault;
};

class CommandTable : public testing::TestWithParam<Row> {};

TEST_P(CommandTable, Holds) {
  const Row& row = GetParam();
  const auto gives = [&](Command command, std::optional<State> to) {
    NodeStateMachine machine = machine_in(row.from);
    EXPECT_EQ(machine.request(command), to.has_value());
    EXPECT_EQ(machine.state(), to.value_or(row.from));
  };
  gives(Command::enable, row.enable);
  gives(Command::disable, row.disable);
  gives(Command::quick_stop, row.quick_stop);
  gives(Command::reset_fault, row.reset_fault);
}

constexpr State kOff = State::switch_on_disabled;
constexpr State kOn = State::operation_enabled;
constexpr auto kRefused = std::nullopt;

// Every stable state with every command.
INSTANTIATE_TEST_SUITE_P(
    NodeStateMachine, CommandTable,
    testing::Values(Row{State::not_ready, kRefused, kRefused, kRefused, kRefused},
                    Row{kOff, kOn, kOff, kOff, kOff}, Row{kOn, kOn, kOff, State::quick_stop, kOn},
                    Row{State::measuring, State::measuring, kRefused, State::quick_stop,
                        State::measuring},
                    Row{State::quick_stop, kRefused, kRefused, State::quick_stop, kRefused},
                    Row{State::fault_reaction, kRefused, kRefused, kRefused, kRefused},
                    Row{State::fault, kRefused, kRefused, kRefused, kOff}));

TEST(NodeStateMachine, MeasuresOnlyWhenEnabled) {
  for (const State state : {State::not_ready, State::switch_on_disabled, State::measuring,
                            State::quick_stop, State::fault_reaction, State::fault}) {
    NodeStateMachine machine = machine_in(state);
    EXPECT_FALSE(machine.begin_measuring()) << to_string(state);
    EXPECT_EQ(machine.state(), state);
  }
}

TEST(NodeStateMachine, EndsAFaultReactionOnlyAtRest) {
  NodeStateMachine machine = machine_in(State::measuring);
  machine.fail(FaultCause::limit);
  EXPECT_EQ(machine.state(), State::fault_reaction);
  EXPECT_TRUE(machine.powered());
  machine.end_measuring();
  machine.self_test_passed();
  EXPECT_EQ(machine.state(), State::fault_reaction);
  machine.at_rest();
  EXPECT_EQ(machine.state(), State::fault);
  EXPECT_FALSE(machine.powered());
}

TEST(NodeStateMachine, GoesToFaultAtOnceWhereNoForceActs) {
  NodeStateMachine machine = machine_in(State::switch_on_disabled);
  machine.fail(FaultCause::interlock);
  EXPECT_EQ(machine.state(), State::fault);
}

TEST(NodeStateMachine, KeepsTheFirstCauseUntilTheReset) {
  NodeStateMachine machine = machine_in(State::measuring);
  machine.fail(FaultCause::limit);
  machine.fail(FaultCause::watchdog);
  EXPECT_EQ(machine.cause(), FaultCause::limit);
  machine.at_rest();
  machine.fail(FaultCause::interlock);
  EXPECT_EQ(machine.cause(), FaultCause::limit);
  EXPECT_TRUE(machine.request(Command::reset_fault));
  EXPECT_EQ(machine.cause(), FaultCause::none);
}

TEST(NodeStateMachine, QuickStopEndsSwitchedOffAndAFaultInItWins) {
  NodeStateMachine machine = machine_in(State::quick_stop);
  EXPECT_TRUE(machine.powered());
  machine.at_rest();
  EXPECT_EQ(machine.state(), State::switch_on_disabled);
  machine = machine_in(State::quick_stop);
  machine.fail(FaultCause::interlock);
  EXPECT_EQ(machine.state(), State::fault_reaction);
}

TEST(NodeStateMachine, NamesEveryCauseDifferently) {
  std::set<std::string> names;
  const auto last = static_cast<int>(FaultCause::host_heartbeat);
  for (int i = 0; i <= last; ++i) names.insert(to_string(static_cast<FaultCause>(i)));
  EXPECT_EQ(names.size(), static_cast<std::size_t>(last + 1));
  EXPECT_STREQ(to_string(static_cast<FaultCause>(200)), "unknown");
}

}  // namespace stageid::test_node_state_machine
