#include "hal/can/can_link.hpp"

#include <fmt/format.h>

#include <exception>
#include <random>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/stage/peer_status.hpp"

namespace stageid {
namespace {

constexpr int kAttempts = 10;  // commands must get through even if half of all frames are lost
constexpr std::int64_t kAnswer_ns = 60'000'000;
constexpr std::int64_t kSecondAnswer_ns = 10'000'000;  // nodes answer within a millisecond

// The low byte numbers a transfer, and 0 means no transfer.
std::uint32_t draw_host() {
  std::random_device random;
  std::uint32_t host = 0;
  do host = random();
  while ((host & 0xFFU) == 0);
  return host;
}

}  // namespace

CanLink::CanLink(CanTransport& transport, std::uint32_t fingerprint,
                 std::function<bool()> interrupted)
    : transport_(transport),
      fingerprint_(fingerprint),
      interrupted_(std::move(interrupted)),
      host_(draw_host()),
      // A restarted host must not reuse numbers that the node remembers.
      sequence_(static_cast<std::uint16_t>(transport.now_ns() / 1000)),
      inbox_(kCanInboxFrames),
      text_(kCanTextParts) {}

/// Answers of version 1 lack the host's number, but must be accepted here to report the version mismatch.
bool CanLink::answers(const CanState& state, std::uint16_t sequence) const noexcept {
  return state.sequence == sequence && state.answer != CanAnswer::none &&
         (state.host == host_ || state.version != kCanProtocolVersion);
}

bool CanLink::take(const CanFrame& frame) noexcept {
  if (frame.id == kCanStateId) {
    CanState state;
    if (!decode_can_state(frame, state)) return true;
    if (boot_ != 0 && state.boot != boot_) {
      other_node_ = true;
      return true;
    }
    state_ = state;
    ++states_;
    if (state.session != 0 && state.host == host_) session_ = state.session;
    return true;
  }
  if (frame.id != kCanTextId) return false;
  try {
    std::size_t part = 0;
    std::string piece;
    if (decode_can_text(frame, part, piece)) text_[part] = std::move(piece);
  } catch (const std::exception&) {  // out of memory: the text is optional
  }
  return true;
}

std::string CanLink::text() const {
  std::string text;
  for (const std::string& piece : text_) text += piece;
  return text;
}

// The deadline is checked on every iteration, because a bus may never be silent.
bool CanLink::wait_for_answer(const CanCommand& command, const Other& other) {
  const std::int64_t until_ns = transport_.now_ns() + kAnswer_ns;
  while (true) {
    const std::size_t count = transport_.receive(inbox_);
    bool answered = false;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint64_t before = states_;
      if (!take(inbox_[i]) && other) other(inbox_[i]);
      if (states_ == before || !answers(state_, command.sequence)) continue;
      answered = true;
      answer_ = state_;
      if (boot_ == 0) boot_ = state_.boot;
    }
    if (answered) return true;
    if (transport_.now_ns() >= until_ns || interrupted()) return false;
    if (count == 0) transport_.wait(until_ns);
  }
}

bool CanLink::exchange(CanCommand command, const Other& other) {
  command.sequence = ++sequence_;
  command.host = host_;
  command.session = session_;
  for (std::string& piece : text_) piece.clear();
  const CanFrame frame = encode_can_command(command);
  for (int attempt = 0; attempt < kAttempts && !interrupted(); ++attempt) {
    static_cast<void>(transport_.send({&frame, 1}));
    if (wait_for_answer(command, other)) return true;
  }
  return false;
}

CanState CanLink::command(const CanCommand& command, const Other& other) {
  const std::string place = fmt::format("can: {}", transport_.name(0));
  const bool greeting = boot_ == 0;
  const bool answered = exchange(command, other);
  if (other_node_ && !greeting) refuse(PeerStatus::other_node, place, "; start the run again");
  if (!answered) {
    require<StageError>(!interrupted(), "{}: interrupted", place);
    const WorstBus worst = worst_bus(transport_);
    require<StageError>(worst.state < CanBusState::passive,
                        "can: {}: {}; check the cable and 'ip -details link show {}'",
                        transport_.name(worst.bus), to_string(worst.state),
                        transport_.name(worst.bus));
  }
  require<StageError>(answered,
                      "{}: no node answered within {} ms; start 'stageid node', and check the "
                      "cable, interface and bit rates",
                      place, kAttempts * kAnswer_ns / 1'000'000);
  if (answer_.version != kCanProtocolVersion)
    refuse(PeerStatus::other_version, place,
           fmt::format(" ({}; expected {}); update the older program", answer_.version,
                       kCanProtocolVersion));
  require<StageError>(answer_.answer == CanAnswer::accepted, "{}: the node refused the command: {}",
                      place, text());
  return answer_;
}

bool CanLink::try_command(const CanCommand& command) noexcept {
  try {
    // An interrupted run must still be stopped.
    std::function<bool()> interrupted;
    std::swap(interrupted, interrupted_);
    const bool answered = exchange(command, {});
    std::swap(interrupted, interrupted_);
    return answered && answer_.answer == CanAnswer::accepted;
  } catch (const std::exception&) {
    return false;
  }
}

void CanLink::listen_for_a_second_node() {
  const std::int64_t until_ns = transport_.now_ns() + kSecondAnswer_ns;
  while (transport_.now_ns() < until_ns) {
    const std::size_t count = transport_.receive(inbox_);
    for (std::size_t i = 0; i < count; ++i) static_cast<void>(take(inbox_[i]));
    if (count == 0) transport_.wait(until_ns);
  }
}

CanState CanLink::greet(bool reset_fault) {
  const std::string place = fmt::format("can: {}", transport_.name(0));
  boot_ = 0;
  other_node_ = false;
  CanState state = command({CanCommandCode::hello});
  listen_for_a_second_node();
  if (other_node_)
    refuse(PeerStatus::two_nodes, place,
           "; connect only one node with these identifiers to each bus");
  if (state.fingerprint != fingerprint_)
    refuse(
        PeerStatus::other_stage, place,
        " (sample rate, channels, buses or ranges differ); use the same stage file on both sides");
  if (reset_fault && state.state == NodeState::fault)
    state = command({CanCommandCode::reset_fault});
  if (state.state == NodeState::fault || state.state == NodeState::fault_reaction)
    refuse(PeerStatus::in_fault, place,
           fmt::format(" ({}); remove the cause and add --reset-fault", text()));
  return state;
}

}  // namespace stageid
