#pragma once

#include "hal/stage/stage.hpp"
#include "hal/stage/supervisor.hpp"

namespace stageid {

/// Drive states based on CiA 402, as far as a stage needs them.
///
///   not_ready -> switch_on_disabled -> ready -> switched_on -> operation_enabled <-> measuring
///   quick_stop: from operation_enabled and measuring, by request; ends in switch_on_disabled
///   fault_reaction: from anywhere, by fail(); ends in fault
///   fault: left by SupervisorCommand::reset_fault only, to switch_on_disabled
///
/// quick_stop and fault_reaction last until at_rest(). The first cause of a fault is kept until the reset.
/// Nothing here allocates, waits or throws.
class NodeStateMachine {
 public:
  NodeState state() const noexcept { return state_; }
  FaultCause cause() const noexcept { return cause_; }
  /// Whether forces may act on the stage.
  bool powered() const noexcept;

  /// After the self test: not_ready -> switch_on_disabled.
  void self_test_passed() noexcept;
  /// `enable` passes through all states up to operation_enabled; `disable` goes down to switch_on_disabled,
  /// but not from measuring. A command whose target state is already reached is accepted.
  /// @return false: not permitted in this state; nothing changed.
  [[nodiscard]] bool request(SupervisorCommand command) noexcept;
  /// operation_enabled -> measuring. @return false in any other state.
  [[nodiscard]] bool begin_measuring() noexcept;
  /// measuring -> operation_enabled; nothing in any other state.
  void end_measuring() noexcept;
  /// Goes to fault_reaction if forces may act, otherwise directly to fault.
  void fail(FaultCause cause) noexcept;
  /// The stage is at rest and its forces are off.
  void at_rest() noexcept;

 private:
  NodeState state_ = NodeState::not_ready;
  FaultCause cause_ = FaultCause::none;
};

}  // namespace stageid
