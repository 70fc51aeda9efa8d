#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/can/can_encoding.hpp"
#include "hal/can/can_transport.hpp"

namespace stageid {

/// The host's side of commands and states, common to CanStage and CanResidentStage.
///
/// It draws a host number, which all commands carry and the node's answers repeat. It also stores the key of
/// the run that the node has begun for this host.
class CanLink {
 public:
  /// Handler of frames that are neither state nor text.
  using Other = std::function<void(const CanFrame&)>;

  /// `interrupted` is called between attempts; true ends them. Empty: never interrupted.
  CanLink(CanTransport& transport, std::uint32_t fingerprint,
          std::function<bool()> interrupted = {});

  /// Sends the command until the node answers, at most ten times.
  /// @throws StageError if there is no answer, or with the node's text if it refuses.
  CanState command(const CanCommand& command, const Other& other = {});
  /// The same without exceptions. @returns false if the command was refused or not answered.
  bool try_command(const CanCommand& command) noexcept;

  /// Identifies the node. Clears a fault first if `reset_fault`.
  /// @throws StageError also if the node has another protocol version or another stage
  /// file, or is in fault, or if two nodes answer.
  CanState greet(bool reset_fault);

  /// Processes a state or text frame. @returns false for other frames.
  bool take(const CanFrame& frame) noexcept;
  /// Last state of the greeted node; it is new if `states()` has increased.
  const CanState& state() const noexcept { return state_; }
  std::uint64_t states() const noexcept { return states_; }
  /// Whether a node other than the greeted one has answered since.
  bool other_node() const noexcept { return other_node_; }
  /// Last text message of the node.
  std::string text() const;

  std::uint32_t host() const noexcept { return host_; }
  /// Key of the run; 0: no run has begun.
  std::uint32_t session() const noexcept { return session_; }
  void forget_session() noexcept { session_ = 0; }
  bool interrupted() const { return interrupted_ && interrupted_(); }

 private:
  bool exchange(CanCommand command, const Other& other);
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
  std::vector<CanFrame> inbox_;
  std::vector<std::string> text_;
};

}  // namespace stageid
