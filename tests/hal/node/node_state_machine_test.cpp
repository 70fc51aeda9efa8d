#include "hal/node/node_state_machine.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace stageid {
namespace test_node_state_machine {

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

/// One row of the table: the effect of a command in a state. A refused command changes nothing.
struct Row {
  State from;
  Command command;
  bool accepted;
  State to;
};

class CommandTable : public testing::TestWithParam<Row> {};

TEST_P(CommandTable, Holds) {
  const Row row = GetParam();
  NodeStateMachine machine = machine_in(row.from);
  EXPECT_EQ(machine.request(row.command), row.accepted);
  EXPECT_EQ(machine.state(), row.to);
}

// Every stable state with every command.
INSTANTIATE_TEST_SUITE_P(
    NodeStateMachine, CommandTable,
    testing::Values(
        Row{State::not_ready, Command::enable, false, State::not_ready},
        Row{State::not_ready, Command::disable, false, State::not_ready},
        Row{State::not_ready, Command::quick_stop, false, State::not_ready},
        Row{State::not_ready, Command::reset_fault, false, State::not_ready},
        Row{State::switch_on_disabled, Command::enable, true, State::operation_enabled},
        Row{State::switch_on_disabled, Command::disable, true, State::switch_on_disabled},
        Row{State::switch_on_disabled, Command::quick_stop, true, State::switch_on_disabled},
        Row{State::switch_on_disabled, Command::reset_fault, true, State::switch_on_disabled},
        Row{State::operation_enabled, Command::enable, true, State::operation_enabled},
        Row{State::operation_enabled, Command::disable, true, State::switch_on_disabled},
        Row{State::operation_enabled, Command::quick_stop, true, State::quick_stop},
        Row{State::operation_enabled, Command::reset_fault, true, State::operation_enabled},
        Row{State::measuring, Command::enable, true, State::measuring},
        Row{State::measuring, Command::disable, false, State::measuring},
        Row{State::measuring, Command::quick_stop, true, State::quick_stop},
        Row{State::measuring, Command::reset_fault, true, State::measuring},
        Row{State::quick_stop, Command::enable, false, State::quick_stop},
        Row{State::quick_stop, Command::disable, false, State::quick_stop},
        Row{State::quick_stop, Command::quick_stop, true, State::quick_stop},
        Row{State::quick_stop, Command::reset_fault, false, State::quick_stop},
        Row{State::fault_reaction, Command::enable, false, State::fault_reaction},
        Row{State::fault_reaction, Command::disable, false, State::fault_reaction},
        Row{State::fault_reaction, Command::quick_stop, false, State::fault_reaction},
        Row{State::fault_reaction, Command::reset_fault, false, State::fault_reaction},
        Row{State::fault, Command::enable, false, State::fault},
        Row{State::fault, Command::disable, false, State::fault},
        Row{State::fault, Command::quick_stop, false, State::fault},
        Row{State::fault, Command::reset_fault, true, State::switch_on_disabled}));

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

}  // namespace test_node_state_machine
}  // namespace stageid
