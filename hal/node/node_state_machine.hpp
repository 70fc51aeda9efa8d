#pragma once

#include <cstdint>

#include "hal/stage/stage.hpp"
#include "hal/stage/supervisor.hpp"

namespace stageid {

/// The states of a drive after CiA 402, as far as a stage needs them.
///
///   not_ready -> switch_on_disabled -> ready -> switched_on -> operation_enabled <-> measuring
///   quick_stop: from operation_enabled and measuring, by request; ends in switch_on_disabled
///   fault_reaction: from anywhere, by fail(); ends in fault
///   fault: left by SupervisorCommand::reset_fault only, to switch_on_disabled
///
/// quick_stop and fault_reaction last until the stage has come to rest: at_rest() ends them. A
/// fault's first cause is kept until the reset. Nothing here allocates, waits or throws.
class NodeStateMachine {
 public:
  NodeState state() const noexcept { return state_; }
  FaultCause cause() const noexcept { return cause_; }
  /// Forces may act on the stage.
  bool powered() const noexcept;

  /// The self test is over: not_ready -> switch_on_disabled.
  void self_test_passed() noexcept;
  /// `enable` goes up one state after the other to operation_enabled; `disable` down to
  /// switch_on_disabled, but not out of measuring. A command that asks for what is there already is
  /// accepted.
  /// @return false: not allowed in this state; nothing changed.
  [[nodiscard]] bool request(SupervisorCommand command) noexcept;
  /// operation_enabled -> measuring. @return false in any other state.
  [[nodiscard]] bool begin_measuring() noexcept;
  /// measuring -> operation_enabled; nothing in any other state.
  void end_measuring() noexcept;
  /// Goes to fault_reaction if forces may act, else to fault at once.
  void fail(FaultCause cause) noexcept;
  /// The stage stands and its forces are off.
  void at_rest() noexcept;

 private:
  NodeState state_ = NodeState::not_ready;
  FaultCause cause_ = FaultCause::none;
};

}  // namespace stageid
