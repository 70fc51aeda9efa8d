#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/can/can_layout.hpp"
#include "hal/can/can_messages.hpp"
#include "hal/can/can_transport.hpp"

namespace stageid {

/// The host's side of commands and states: what CanStage and CanResidentStage have in common.
///
/// It draws a number for its host, which all commands carry and the node's answers repeat, and keeps
/// the key of the run that the node has begun for it.
class CanLink {
 public:
  /// Frames that are neither state nor text.
  using Other = std::function<void(const CanFrame&)>;

  /// `interrupted` is asked between attempts; true ends them. Empty: never.
  CanLink(CanTransport& transport, std::uint32_t fingerprint,
          std::function<bool()> interrupted = {});

  /// Sends the command until the node answers, ten times at most, and waits for the answer.
  /// @throws StageError if nobody answers, or the node refuses (in its own words).
  CanState command(CanCommand command, const Other& other = {});
  /// The same without exceptions. @returns false if it was not answered or refused.
  bool try_command(CanCommand command) noexcept;

  /// Asks the node who it is. Clears a fault first if `reset_fault`.
  /// @throws StageError also if the node speaks another version, was started with another stage
  /// file, or is in fault, or if two nodes answer.
  CanState greet(bool reset_fault);

  /// Takes a state or text frame. @returns false if it is neither.
  bool take(const CanFrame& frame) noexcept;
  /// The last state that came from the node that was greeted; it is new if `states()` has grown.
  const CanState& state() const noexcept { return state_; }
  std::uint64_t states() const noexcept { return states_; }
  /// Another node than the one that was greeted has answered since.
  bool other_node() const noexcept { return other_node_; }
  /// What the node said in words last.
  std::string text() const;
  std::uint64_t damaged() const noexcept { return damaged_; }

  std::uint32_t host() const noexcept { return host_; }
  /// Key of the run; 0: none has begun.
  std::uint32_t session() const noexcept { return session_; }
  void forget_session() noexcept { session_ = 0; }
  bool interrupted() const { return interrupted_ && interrupted_(); }

 private:
  bool exchange(const CanCommand& command, const Other& other);
  bool wait_for_answer(const CanCommand& command, const Other& other);
  bool answers(const CanState& state, std::uint16_t sequence) const noexcept;
  void listen_for_a_second_node();

  CanTransport& transport_;
  std::uint32_t fingerprint_;
  std::function<bool()> interrupted_;
  std::uint32_t host_;
  std::uint32_t session_ = 0;
  std::uint32_t boot_ = 0;  // 0: not greeted
  bool other_node_ = false;
  std::uint16_t sequence_;
  CanState state_;
  CanState answer_;  // to the last command
  std::uint64_t states_ = 0;
  std::uint64_t damaged_ = 0;
  std::vector<CanFrame> inbox_;
  std::vector<std::string> text_;
};

}  // namespace stageid
