#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "hal/can/can_frame.hpp"
#include "hal/can/can_layout.hpp"
#include "hal/node/node_state_machine.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

// What stands behind the header of each kind of frame. docs/can-protocol.md is the same for people.

inline constexpr std::uint8_t kCanProtocolVersion = 2;
inline constexpr double kCanHeartbeatRate_hz = 10.0;

/// Setpoints and measurements: kind is 0 in a setpoint, the NodeState in a measurement (plus
/// kCanSaturatedBit); sequence n + 1 stands for u[n] and for its answer y[n+1], 0 for y[0].
inline constexpr std::uint8_t kCanSaturatedBit = 0x80;

/// The part of a run's key that its frames carry: the low byte in `run`, in setpoints the next two
/// in `detail`.
constexpr std::uint8_t can_run(std::uint32_t session) noexcept {
  return static_cast<std::uint8_t>(session);
}
constexpr std::uint16_t can_tag(std::uint32_t session) noexcept {
  return static_cast<std::uint16_t>(session >> 8);
}

/// Counts of what was put into frames.
struct CanConversions {
  std::uint64_t saturated = 0;
  std::uint64_t no_number = 0;
};

/// Fills in values of the frame's channels (NaN: no value) and the header.
void encode_can_values(const CanValueFrame& layout, std::span<const CanScale> scale,
                       std::span<const double> values, CanHeader header, CanFrame& frame,
                       CanConversions& conversions) noexcept;
/// Puts the values of the frame's channels in their places of `values`. @returns false and leaves
/// them alone if the frame is damaged or of another length.
[[nodiscard]] bool decode_can_values(const CanValueFrame& layout, std::span<const CanScale> scale,
                                     const CanFrame& frame, CanHeader& header,
                                     std::span<double> values) noexcept;

/// Host to node. The node answers each with a CanState of the same sequence.
enum class CanCommandCode : std::uint8_t {
  hello = 1,        ///< say who you are
  start = 2,        ///< a: run seed. Enables, begins to measure, sends y[0]
  stop = 3,         ///< ends the measurement, disables
  quick_stop = 4,   ///< safe stop
  reset_fault = 5,  ///< leaves fault
  upload = 16,      ///< a: mask of actuators, b: digest, c: samples. Waveform memory is made ready
  missing = 17,     ///< answered by a CanMissing frame beside the state
  arm = 18,         ///< a: run seed, b: samples to record, c: samples of the ramp, d: low digest
  trigger = 19,     ///< begins
  download = 20,    ///< a: first chunk, b: CanMemory, c: chunks. Sent as CanChunk frames
};
struct CanCommand {
  CanCommandCode code = CanCommandCode::hello;
  std::uint16_t sequence = 0;
  std::uint64_t a = 0;
  std::uint64_t b = 0;
  std::uint32_t c = 0;
  std::uint32_t d = 0;
  std::uint32_t host = 0;     ///< drawn by each host; its low byte, not 0, numbers its transfers
  std::uint32_t session = 0;  ///< key of the run, from the answer that began it
  std::uint8_t version = kCanProtocolVersion;
};
inline constexpr std::size_t kCanCommandBytes = 33;
CanFrame encode_can_command(const CanCommand& command) noexcept;
/// A command of version 1, which was shorter, comes back with that version and nothing else in it
/// but its code and sequence.
[[nodiscard]] bool decode_can_command(const CanFrame& frame, CanCommand& command) noexcept;

enum class CanAnswer : std::uint8_t { none, accepted, refused };
enum class CanResident : std::uint8_t { idle, armed, playing, done, failed };

/// Node to host: after every command, at every change of state, and as a heartbeat. Codes that this
/// program does not know come through as they are: peer_status.hpp says what they mean.
struct CanState {
  std::uint16_t sequence = 0;  ///< of the command that is answered
  NodeState state = NodeState::not_ready;
  std::uint8_t run = 0;  ///< of the key of the last run
  std::uint8_t version = kCanProtocolVersion;
  FaultCause cause = FaultCause::none;
  CanAnswer answer = CanAnswer::none;
  CanResident resident = CanResident::idle;
  std::uint32_t gaps = 0;      ///< samples that were never asked for, of this run
  std::uint32_t repeated = 0;  ///< setpoints that came again
  std::uint32_t rejected = 0;  ///< frames with our identifiers that were damaged or foreign
  std::uint64_t sample = 0;    ///< of this run
  std::uint32_t fingerprint = 0;
  std::uint32_t boot = 0;     ///< drawn at every start of the node
  std::uint32_t host = 0;     ///< whose command is answered; 0: none
  std::uint32_t session = 0;  ///< the key, in answers to the host that has the stage; else 0
};
inline constexpr std::size_t kCanStateBytes = 40;
CanFrame encode_can_state(const CanState& state) noexcept;
[[nodiscard]] bool decode_can_state(const CanFrame& frame, CanState& state) noexcept;

/// What the node says in words (why it refused, why it is in fault), in kCanTextParts frames.
inline constexpr std::size_t kCanTextParts = 3;
CanFrame encode_can_text(const std::string& text, std::size_t part, std::uint8_t run) noexcept;
[[nodiscard]] bool decode_can_text(const CanFrame& frame, std::size_t& part, std::string& piece);

/// A piece of a transfer, in either direction.
inline constexpr std::size_t kCanChunkBytes = 56;
inline constexpr std::size_t kCanFloatBytes = 4;
/// Chunks that carry so many bytes.
constexpr std::size_t can_chunks(std::size_t bytes) noexcept {
  return (bytes + kCanChunkBytes - 1) / kCanChunkBytes;
}
struct CanChunk {
  std::uint32_t index = 0;  ///< 24 bits
  std::uint8_t token = 0;   ///< of the transfer
  std::span<const std::uint8_t> bytes;
};
CanFrame encode_can_chunk(std::uint16_t id, const CanChunk& chunk) noexcept;
/// `chunk.bytes` points into the frame.
[[nodiscard]] bool decode_can_chunk(const CanFrame& frame, CanChunk& chunk) noexcept;

enum class CanMemory : std::uint8_t { waveform = 0, trace = 1 };

/// Which chunks of an upload the node has: all before `first`, and from there on as the bits say.
struct CanMissing {
  std::uint32_t first = 0;
  std::uint8_t token = 0;
  std::array<std::uint8_t, 48> received{};
};
inline constexpr std::uint32_t kCanMissingBits = 384;
CanFrame encode_can_missing(const CanMissing& missing) noexcept;
[[nodiscard]] bool decode_can_missing(const CanFrame& frame, CanMissing& missing) noexcept;

/// Digest of a whole transfer, FNV-1a, 64 bit: that every piece came to its place; against bit
/// errors there is the CRC of each frame. Source: draft-eastlake-fnv.
std::uint64_t can_digest(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace stageid
