#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/can_layout.hpp"
#include "hal/can_messages.hpp"
#include "hal/can_transport.hpp"

namespace stageid {

/// The host's side of commands and states: what CanStage and CanResidentStage have in common.
class CanLink {
 public:
  /// Frames that are neither state nor text.
  using Other = std::function<void(const CanFrame&)>;

  CanLink(CanTransport& transport, std::uint32_t fingerprint);

  /// Sends the command until the node answers, ten times at most, and waits for the answer.
  /// @throws StageError if nobody answers, or the node refuses (in its own words).
  CanState command(CanCommand command, const Other& other = {});
  /// The same without exceptions. @returns false if it was not answered or refused.
  bool try_command(CanCommand command) noexcept;

  /// Asks the node who it is. Clears a fault first if `reset_fault`.
  /// @throws StageError also if the node speaks another version, was started with another stage
  /// file, or is in fault.
  CanState greet(bool reset_fault);

  /// Takes a state or text frame. @returns false if it is neither.
  bool take(const CanFrame& frame) noexcept;
  /// The last state that came; it is new if `states()` has grown.
  const CanState& state() const noexcept { return state_; }
  std::uint64_t states() const noexcept { return states_; }
  /// What the node said in words last.
  std::string text() const;
  std::int64_t last_heard_ns() const noexcept { return last_heard_ns_; }
  std::uint64_t damaged() const noexcept { return damaged_; }

 private:
  bool exchange(const CanCommand& command, const Other& other);
  bool wait_for_answer(const CanCommand& command, const Other& other);

  CanTransport& transport_;
  std::uint32_t fingerprint_;
  std::uint16_t sequence_;
  CanState state_;
  std::uint64_t states_ = 0;
  std::uint64_t damaged_ = 0;
  std::int64_t last_heard_ns_ = 0;
  std::vector<CanFrame> inbox_;
  std::vector<std::string> text_;
};

}  // namespace stageid
