#include "hal/can_link.hpp"

#include <fmt/format.h>

#include <exception>

namespace stageid {
namespace {

constexpr int kAttempts = 10;  // a bus that loses half of its frames is still a bus
constexpr std::int64_t kAnswer_ns = 60'000'000;
constexpr std::size_t kInboxFrames = 64;

}  // namespace

CanLink::CanLink(CanTransport& transport, std::uint32_t fingerprint)
    : transport_(transport),
      fingerprint_(fingerprint),
      // A host that was started anew must not go on with numbers the node remembers.
      sequence_(static_cast<std::uint16_t>(transport.now_ns() / 1000)),
      inbox_(kInboxFrames),
      text_(kCanTextParts) {}

bool CanLink::take(const CanFrame& frame) noexcept {
  if (frame.id == kCanStateId) {
    CanState state;
    if (!decode_can_state(frame, state)) {
      ++damaged_;
      return true;
    }
    state_ = state;
    ++states_;
    last_heard_ns_ = frame.t_rx_ns;
    return true;
  }
  if (frame.id != kCanTextId) return false;
  try {
    std::size_t part = 0;
    std::string piece;
    if (decode_can_text(frame, part, piece)) text_[part] = std::move(piece);
  } catch (const std::exception&) {  // no memory for a text: it is only a text
  }
  return true;
}

std::string CanLink::text() const {
  std::string text;
  for (const std::string& piece : text_) text += piece;
  return text;
}

bool CanLink::wait_for_answer(const CanCommand& command, const Other& other) {
  const std::int64_t until_ns = transport_.now_ns() + kAnswer_ns;
  while (true) {
    const std::size_t count = transport_.receive(inbox_);
    bool answered = false;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint64_t before = states_;
      if (!take(inbox_[i]) && other) other(inbox_[i]);
      answered |= states_ != before && state_.sequence == command.sequence &&
                  state_.answer != CanAnswer::none;
    }
    if (answered) return true;
    if (count == 0 && transport_.now_ns() >= until_ns) return false;
    if (count == 0) transport_.wait(until_ns);
  }
}

bool CanLink::exchange(const CanCommand& command, const Other& other) {
  for (std::string& piece : text_) piece.clear();
  const CanFrame frame = encode_can_command(command);
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    static_cast<void>(transport_.send({&frame, 1}));
    if (wait_for_answer(command, other)) return true;
  }
  return false;
}

CanState CanLink::command(CanCommand command, const Other& other) {
  command.sequence = ++sequence_;
  const std::string& bus = transport_.name(0);
  if (!exchange(command, other)) {
    const WorstBus worst = worst_bus(transport_);
    if (worst.state >= CanBusState::passive)
      throw StageError(fmt::format(
          "can: {}: {}; look at the cable and at 'ip -details link show {}'",
          transport_.name(worst.bus), to_string(worst.state), transport_.name(worst.bus)));
    throw StageError(
        fmt::format("can: {}: no node answers within {} ms; start 'stageid node', look at cable, "
                    "interface and bit rates",
                    bus, kAttempts * kAnswer_ns / 1'000'000));
  }
  if (state_.answer == CanAnswer::refused)
    throw StageError(fmt::format("can: {}: the node refuses: {}", bus, text()));
  return state_;
}

bool CanLink::try_command(CanCommand command) noexcept {
  try {
    command.sequence = ++sequence_;
    return exchange(command, {}) && state_.answer == CanAnswer::accepted;
  } catch (const std::exception&) {
    return false;
  }
}

CanState CanLink::greet(bool reset_fault) {
  const std::string& bus = transport_.name(0);
  CanState state = command({CanCommandCode::hello});
  if (state.version != kCanProtocolVersion)
    throw StageError(fmt::format("can: {}: the node speaks version {} of the protocol, not {}", bus,
                                 state.version, kCanProtocolVersion));
  if (state.fingerprint != fingerprint_)
    throw StageError(
        fmt::format("can: {}: the node was started with another stage file (rate, channels, buses "
                    "or ranges differ); give both the same",
                    bus));
  if (reset_fault && state.state == NodeState::fault)
    state = command({CanCommandCode::reset_fault});
  if (state.state == NodeState::fault || state.state == NodeState::fault_reaction)
    throw StageError(fmt::format(
        "can: {}: the node is in fault ({}); remove the cause and add --reset-fault", bus, text()));
  return state;
}

}  // namespace stageid
