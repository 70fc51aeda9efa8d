#include "hal/can/can_encoding.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <tuple>

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

// The bytes of chunk `index` in a memory.
template <typename Byte>
std::span<Byte> part_of(std::span<Byte> memory, std::size_t index) noexcept {
  const std::size_t from = index * kCanChunkBytes;
  return memory.subspan(from, std::min(kCanChunkBytes, memory.size() - from));
}

// The fields of the payload, in order and without gaps.
template <typename Command>
auto fields_of_command(Command& command) noexcept {
  return std::tie(command.a, command.b, command.c, command.d, command.host, command.session,
                  command.version);
}
template <typename State>
auto fields_of_state(State& state) noexcept {
  return std::tie(state.version, state.cause, state.answer, state.resident, state.gaps,
                  state.repeated, state.rejected, state.sample, state.fingerprint, state.boot,
                  state.host, state.session);
}

template <typename Fields, typename Each>
void for_each_field(const Fields& fields, const Each& each) noexcept {
  std::size_t at = kAt;
  std::apply([&](auto&... field) { ((each(field, at), at += sizeof(field)), ...); }, fields);
}

template <typename Fields>
void put_fields(CanFrame& frame, const Fields& fields) noexcept {
  for_each_field(fields, [&](const auto& field, std::size_t at) { put_can(frame, at, field); });
}

template <typename Fields>
void get_fields(const CanFrame& frame, const Fields& fields) noexcept {
  for_each_field(fields, [&]<typename Field>(Field& field, std::size_t at) {
    field = get_can<Field>(frame, at);
  });
}

}  // namespace

CanConversions encode_can_values(const CanValueFrame& layout, std::span<const CanScale> scale,
                                 std::span<const double> values, CanHeader header,
                                 CanFrame& frame) noexcept {
  frame.id = layout.id;
  frame.bus = layout.bus;
  std::size_t at = kAt;
  CanConversions conversions;
  for (const std::size_t channel : layout.channels) {
    const CanConversion result = put_can_value(frame, at, values[channel], scale[channel]);
    conversions.saturated += result == CanConversion::saturated ? 1U : 0U;
    conversions.no_number += result == CanConversion::no_number ? 1U : 0U;
    at += kCanCountBytes;
  }
  if (conversions.saturated > 0) header.kind |= kCanSaturatedBit;
  seal_can_frame(frame, header, layout.payload_bytes());
  return conversions;
}

bool decode_can_values(const CanValueFrame& layout, std::span<const CanScale> scale,
                       const CanFrame& frame, CanHeader& header,
                       std::span<double> values) noexcept {
  if (!open_can_frame(frame, layout.payload_bytes(), header)) return false;
  std::size_t at = kAt;
  for (const std::size_t channel : layout.channels) {
    values[channel] = get_can_value(frame, at, scale[channel]);
    at += kCanCountBytes;
  }
  return true;
}

CanFrame encode_can_command(const CanCommand& command) noexcept {
  CanFrame frame;
  frame.id = kCanCommandId;
  put_fields(frame, fields_of_command(command));
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
  if (old)
    command.version = 1;
  else
    get_fields(frame, fields_of_command(command));
  return quick || slow;
}

CanFrame encode_can_state(const CanState& state) noexcept {
  CanFrame frame;
  frame.id = kCanStateId;
  put_fields(frame, fields_of_state(state));
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
  get_fields(frame, fields_of_state(state));
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

CanFrame encode_can_part(std::uint16_t id, std::uint8_t token, std::size_t index,
                         std::span<const std::uint8_t> memory) noexcept {
  return encode_can_chunk(id, {static_cast<std::uint32_t>(index), token, part_of(memory, index)});
}

bool take_can_part(const CanChunk& chunk, std::span<std::uint8_t> memory) noexcept {
  if (chunk.index >= can_chunks(memory.size())) return false;
  const std::span<std::uint8_t> part = part_of(memory, chunk.index);
  if (chunk.bytes.size() != part.size()) return false;
  std::copy(chunk.bytes.begin(), chunk.bytes.end(), part.begin());
  return true;
}

void append_can_word(std::vector<std::uint8_t>& memory, std::uint32_t word) {
  for (int i = 0; i < 4; ++i) memory.push_back(static_cast<std::uint8_t>(word >> (8 * i)));
}

void append_can_float(std::vector<std::uint8_t>& memory, double value) {
  append_can_word(memory, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
}

double can_float_at(std::span<const std::uint8_t> memory, std::size_t at) noexcept {
  float value = 0.0F;
  std::memcpy(&value, memory.data() + at, kCanFloatBytes);
  return static_cast<double>(value);
}

std::uint64_t can_digest(std::span<const std::uint8_t> bytes) noexcept {
  std::uint64_t value = 0xCBF29CE484222325U;
  for (const std::uint8_t byte : bytes) value = (value ^ byte) * 0x100000001B3U;
  return value;
}

}  // namespace stageid
