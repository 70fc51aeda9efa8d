#include "hal/can/can_encoding.hpp"

#include <algorithm>
#include <cstring>

namespace stageid {
namespace {

constexpr std::size_t kOldCommandBytes = 24;  // version 1
constexpr std::size_t kTextBytes = 56;
constexpr std::size_t kMissingBytes = 48;
constexpr std::size_t kAt = kCanHeaderBytes;

// A 24-bit number in the header's sequence and kind.
CanHeader numbered(std::uint32_t number, std::uint8_t run, std::uint16_t detail) noexcept {
  return {static_cast<std::uint16_t>(number), static_cast<std::uint8_t>(number >> 16), run, detail};
}
std::uint32_t number_of(const CanHeader& header) noexcept {
  return header.sequence | static_cast<std::uint32_t>(header.kind) << 16;
}

}  // namespace

void encode_can_values(const CanValueFrame& layout, std::span<const CanScale> scale,
                       std::span<const double> values, CanHeader header, CanFrame& frame,
                       CanConversions& conversions) noexcept {
  frame.id = layout.id;
  frame.bus = layout.bus;
  std::size_t at = kAt;
  bool saturated = false;
  for (const int channel : layout.channels) {
    const auto index = static_cast<std::size_t>(channel);
    const CanConversion result = put_can_value(frame, at, values[index], scale[index]);
    saturated |= result == CanConversion::saturated;
    conversions.saturated += result == CanConversion::saturated ? 1U : 0U;
    conversions.no_number += result == CanConversion::no_number ? 1U : 0U;
    at += kCanCountBytes;
  }
  if (saturated) header.kind |= kCanSaturatedBit;
  seal_can_frame(frame, header, layout.payload_bytes());
}

bool decode_can_values(const CanValueFrame& layout, std::span<const CanScale> scale,
                       const CanFrame& frame, CanHeader& header,
                       std::span<double> values) noexcept {
  if (!open_can_frame(frame, layout.payload_bytes(), header)) return false;
  std::size_t at = kAt;
  for (const int channel : layout.channels) {
    const auto index = static_cast<std::size_t>(channel);
    values[index] = get_can_value(frame, at, scale[index]);
    at += kCanCountBytes;
  }
  return true;
}

CanFrame encode_can_command(const CanCommand& command) noexcept {
  CanFrame frame;
  frame.id = kCanCommandId;
  put_can(frame, kAt, command.a);
  put_can(frame, kAt + 8, command.b);
  put_can(frame, kAt + 16, command.c);
  put_can(frame, kAt + 20, command.d);
  put_can(frame, kAt + 24, command.host);
  put_can(frame, kAt + 28, command.session);
  put_can(frame, kAt + 32, command.version);
  seal_can_frame(
      frame,
      {command.sequence, static_cast<std::uint8_t>(command.code), can_run(command.session), 0},
      kCanCommandBytes);
  return frame;
}

bool decode_can_command(const CanFrame& frame, CanCommand& command) noexcept {
  CanHeader header;
  if (frame.id != kCanCommandId) return false;
  const bool old = open_can_frame(frame, kOldCommandBytes, header);
  if (!old && !open_can_frame(frame, kCanCommandBytes, header)) return false;
  const bool slow = header.kind >= static_cast<std::uint8_t>(CanCommandCode::upload) &&
                    header.kind <= static_cast<std::uint8_t>(CanCommandCode::download);
  const bool quick = header.kind >= static_cast<std::uint8_t>(CanCommandCode::hello) &&
                     header.kind <= static_cast<std::uint8_t>(CanCommandCode::reset_fault);
  command = {};
  command.code = static_cast<CanCommandCode>(header.kind);
  command.sequence = header.sequence;
  if (old) {
    command.version = 1;
    return quick || slow;
  }
  command.a = get_can<std::uint64_t>(frame, kAt);
  command.b = get_can<std::uint64_t>(frame, kAt + 8);
  command.c = get_can<std::uint32_t>(frame, kAt + 16);
  command.d = get_can<std::uint32_t>(frame, kAt + 20);
  command.host = get_can<std::uint32_t>(frame, kAt + 24);
  command.session = get_can<std::uint32_t>(frame, kAt + 28);
  command.version = get_can<std::uint8_t>(frame, kAt + 32);
  return quick || slow;
}

CanFrame encode_can_state(const CanState& state) noexcept {
  CanFrame frame;
  frame.id = kCanStateId;
  put_can(frame, kAt, state.version);
  put_can(frame, kAt + 1, static_cast<std::uint8_t>(state.cause));
  put_can(frame, kAt + 2, static_cast<std::uint8_t>(state.answer));
  put_can(frame, kAt + 3, static_cast<std::uint8_t>(state.resident));
  put_can(frame, kAt + 4, state.gaps);
  put_can(frame, kAt + 8, state.repeated);
  put_can(frame, kAt + 12, state.rejected);
  put_can(frame, kAt + 16, state.sample);
  put_can(frame, kAt + 24, state.fingerprint);
  put_can(frame, kAt + 28, state.boot);
  put_can(frame, kAt + 32, state.host);
  put_can(frame, kAt + 36, state.session);
  seal_can_frame(frame, {state.sequence, static_cast<std::uint8_t>(state.state), state.run, 0},
                 kCanStateBytes);
  return frame;
}

bool decode_can_state(const CanFrame& frame, CanState& state) noexcept {
  CanHeader header;
  if (frame.id != kCanStateId || !open_can_frame(frame, kCanStateBytes, header)) return false;
  state.sequence = header.sequence;
  state.state = static_cast<NodeState>(header.kind);
  state.run = header.run;
  state.version = get_can<std::uint8_t>(frame, kAt);
  state.cause = static_cast<FaultCause>(get_can<std::uint8_t>(frame, kAt + 1));
  state.answer = static_cast<CanAnswer>(get_can<std::uint8_t>(frame, kAt + 2));
  state.resident = static_cast<CanResident>(get_can<std::uint8_t>(frame, kAt + 3));
  state.gaps = get_can<std::uint32_t>(frame, kAt + 4);
  state.repeated = get_can<std::uint32_t>(frame, kAt + 8);
  state.rejected = get_can<std::uint32_t>(frame, kAt + 12);
  state.sample = get_can<std::uint64_t>(frame, kAt + 16);
  state.fingerprint = get_can<std::uint32_t>(frame, kAt + 24);
  state.boot = get_can<std::uint32_t>(frame, kAt + 28);
  state.host = get_can<std::uint32_t>(frame, kAt + 32);
  state.session = get_can<std::uint32_t>(frame, kAt + 36);
  return true;
}

CanFrame encode_can_text(const std::string& text, std::size_t part, std::uint8_t run) noexcept {
  CanFrame frame;
  frame.id = kCanTextId;
  const std::size_t from = std::min(text.size(), part * kTextBytes);
  std::memcpy(frame.data.data() + kAt, text.data() + from,
              std::min(kTextBytes, text.size() - from));
  seal_can_frame(frame, {0, 0, run, static_cast<std::uint16_t>(part)}, kTextBytes);
  return frame;
}

bool decode_can_text(const CanFrame& frame, std::size_t& part, std::string& piece) {
  CanHeader header;
  if (frame.id != kCanTextId || !open_can_frame(frame, kTextBytes, header)) return false;
  part = header.detail;
  const auto* begin = reinterpret_cast<const char*>(frame.data.data() + kAt);
  piece.assign(begin, std::find(begin, begin + kTextBytes, '\0'));
  return part < kCanTextParts;
}

CanFrame encode_can_chunk(std::uint16_t id, const CanChunk& chunk) noexcept {
  CanFrame frame;
  frame.id = id;
  std::copy(chunk.bytes.begin(), chunk.bytes.end(), frame.data.begin() + kAt);
  seal_can_frame(frame,
                 numbered(chunk.index, chunk.token, static_cast<std::uint16_t>(chunk.bytes.size())),
                 kCanChunkBytes);
  return frame;
}

bool decode_can_chunk(const CanFrame& frame, CanChunk& chunk) noexcept {
  CanHeader header;
  if (!open_can_frame(frame, kCanChunkBytes, header) || header.detail > kCanChunkBytes)
    return false;
  chunk.index = number_of(header);
  chunk.token = header.run;
  chunk.bytes = {frame.data.data() + kAt, header.detail};
  return true;
}

CanFrame encode_can_missing(const CanMissing& missing) noexcept {
  CanFrame frame;
  frame.id = kCanMissingId;
  std::copy(missing.received.begin(), missing.received.end(), frame.data.begin() + kAt);
  seal_can_frame(frame, numbered(missing.first, missing.token, 0), kMissingBytes);
  return frame;
}

bool decode_can_missing(const CanFrame& frame, CanMissing& missing) noexcept {
  CanHeader header;
  if (frame.id != kCanMissingId || !open_can_frame(frame, kMissingBytes, header)) return false;
  missing.first = number_of(header);
  missing.token = header.run;
  std::copy_n(frame.data.begin() + kAt, kMissingBytes, missing.received.begin());
  return true;
}

std::uint64_t can_digest(std::span<const std::uint8_t> bytes) noexcept {
  std::uint64_t value = 0xCBF29CE484222325U;
  for (const std::uint8_t byte : bytes) value = (value ^ byte) * 0x100000001B3U;
  return value;
}

}  // namespace stageid
