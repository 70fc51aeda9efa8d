#include "hal/node/node_state_machine.hpp"

namespace stageid {

bool NodeStateMachine::powered() const noexcept {
  return state_ >= NodeState::switched_on && state_ <= NodeState::fault_reaction;
}

void NodeStateMachine::self_test_passed() noexcept {
  if (state_ == NodeState::not_ready) state_ = NodeState::switch_on_disabled;
}

bool NodeStateMachine::request(SupervisorCommand command) noexcept {
  const bool running = state_ == NodeState::operation_enabled || state_ == NodeState::measuring;
  const bool idle = state_ == NodeState::switch_on_disabled || state_ == NodeState::ready ||
                    state_ == NodeState::switched_on;
  switch (command) {
    case SupervisorCommand::enable:
      if (idle) state_ = NodeState::operation_enabled;
      return idle || running;
    case SupervisorCommand::disable:
      if (state_ == NodeState::operation_enabled || idle) state_ = NodeState::switch_on_disabled;
      return state_ == NodeState::switch_on_disabled;
    case SupervisorCommand::quick_stop:
      if (running) state_ = NodeState::quick_stop;
      return running || idle || state_ == NodeState::quick_stop;
    case SupervisorCommand::reset_fault:
      if (state_ != NodeState::fault) return idle || running;
      state_ = NodeState::switch_on_disabled;
      cause_ = FaultCause::none;
      return true;
  }
  return false;
}

bool NodeStateMachine::begin_measuring() noexcept {
  if (state_ != NodeState::operation_enabled) return false;
  state_ = NodeState::measuring;
  return true;
}

void NodeStateMachine::end_measuring() noexcept {
  if (state_ == NodeState::measuring) state_ = NodeState::operation_enabled;
}

void NodeStateMachine::fail(FaultCause cause) noexcept {
  if (cause_ == FaultCause::none) cause_ = cause;
  if (state_ == NodeState::fault || state_ == NodeState::fault_reaction) return;
  state_ = powered() ? NodeState::fault_reaction : NodeState::fault;
}

void NodeStateMachine::at_rest() noexcept {
  if (state_ == NodeState::quick_stop) state_ = NodeState::switch_on_disabled;
  if (state_ == NodeState::fault_reaction) state_ = NodeState::fault;
}

}  // namespace stageid
