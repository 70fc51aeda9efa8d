#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hal/can/can_frame.hpp"
#include "hal/can/can_layout.hpp"
#include "hal/node/node_state_machine.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

// Payload of each kind of frame, after the header; documented in docs/can-protocol.md.

/// A field of a command or state. The fields follow each other without gaps, little-endian.
struct CanField {
  const char* name;
  std::size_t bytes;
};

inline constexpr std::uint8_t kCanProtocolVersion = 2;
inline constexpr double kCanHeartbeatRate_hz = 10.0;

/// Setpoints and measurements: kind is 0 in a setpoint, the NodeState in a measurement (plus
/// kCanSaturatedBit). Sequence n + 1 belongs to u[n] and its answer y[n+1], 0 to y[0].
inline constexpr std::uint8_t kCanSaturatedBit = 0x80;

/// The part of a run's key in its frames: the low byte in `run`, in setpoints the next two bytes in
/// `detail`.
constexpr std::uint8_t can_run(std::uint32_t session) noexcept {
  return static_cast<std::uint8_t>(session);
}
constexpr std::uint16_t can_tag(std::uint32_t session) noexcept {
  return static_cast<std::uint16_t>(session >> 8);
}

/// Numbers of values that a frame does not carry as they are.
struct CanConversions {
  std::uint64_t saturated = 0;
  std::uint64_t no_number = 0;
};

/// Writes the values of the frame's channels (NaN: no value) and the header.
CanConversions encode_can_values(const CanValueFrame& layout, std::span<const CanScale> scale,
                                 std::span<const double> values, CanHeader header,
                                 CanFrame& frame) noexcept;
/// Decodes the frame's channels into `values`. @returns false without changing them if the frame is damaged
/// or has another length.
[[nodiscard]] bool decode_can_values(const CanValueFrame& layout, std::span<const CanScale> scale,
                                     const CanFrame& frame, CanHeader& header,
                                     std::span<double> values) noexcept;

/// Host to node. The node answers each with a CanState of the same sequence.
enum class CanCommandCode : std::uint8_t {
  hello = 1,        ///< requests identification
  start = 2,        ///< a: run seed. Enables, begins to measure, sends y[0]
  stop = 3,         ///< ends the measurement, disables
  quick_stop = 4,   ///< safe stop
  reset_fault = 5,  ///< leaves fault
  upload = 16,      ///< a: mask of actuators, b: digest, c: samples. Prepares the waveform memory
  missing = 17,     ///< answered by a CanMissing frame in addition to the state
  arm = 18,         ///< a: run seed, b: samples to record, c: samples of the ramp, d: low digest
  trigger = 19,     ///< starts the armed run
  download = 20,    ///< a: first chunk, b: CanMemory, c: chunks. Sent as CanChunk frames
};
struct CanCommand {
  CanCommandCode code = CanCommandCode::hello;
  std::uint16_t sequence = 0;
  std::uint64_t a = 0;
  std::uint64_t b = 0;
  std::uint32_t c = 0;
  std::uint32_t d = 0;
  std::uint32_t host = 0;     ///< random; its low byte, not 0, numbers the host's transfers
  std::uint32_t session = 0;  ///< key of the run, from the answer to start or arm
  std::uint8_t version = kCanProtocolVersion;
  friend bool operator==(const CanCommand&, const CanCommand&) = default;
};
inline constexpr CanField kCanCommandFields[] = {
    {"a", 8}, {"b", 8}, {"c", 4}, {"d", 4}, {"host", 4}, {"session", 4}, {"version", 1}};
inline constexpr std::size_t kCanCommandBytes = 33;
CanFrame encode_can_command(const CanCommand& command) noexcept;
/// A command of version 1 was shorter: only its version, code and sequence are decoded.
[[nodiscard]] bool decode_can_command(const CanFrame& frame, CanCommand& command) noexcept;

enum class CanAnswer : std::uint8_t { none, accepted, refused };
enum class CanResident : std::uint8_t { idle, armed, playing, done, failed };

/// Node to host: after every command, at every change of state, and as a heartbeat. Unknown codes are
/// passed on unchanged; see peer_status.hpp.
struct CanState {
  std::uint16_t sequence = 0;  ///< of the answered command
  NodeState state = NodeState::not_ready;
  std::uint8_t run = 0;  ///< of the key of the last run
  std::uint8_t version = kCanProtocolVersion;
  FaultCause cause = FaultCause::none;
  CanAnswer answer = CanAnswer::none;
  CanResident resident = CanResident::idle;
  std::uint32_t gaps = 0;      ///< missing samples of this run
  std::uint32_t repeated = 0;  ///< duplicate setpoints
  std::uint32_t rejected = 0;  ///< damaged or foreign frames with identifiers of this protocol
  std::uint64_t sample = 0;    ///< of this run
  std::uint32_t fingerprint = 0;
  std::uint32_t boot = 0;     ///< random, new at every start of the node
  std::uint32_t host = 0;     ///< host of the answered command; 0: none
  std::uint32_t session = 0;  ///< the key, in answers to the host that owns the stage; otherwise 0
  friend bool operator==(const CanState&, const CanState&) = default;
};
inline constexpr CanField kCanStateFields[] = {{"version", 1},  {"cause", 1},  {"answer", 1},
                                               {"resident", 1}, {"gaps", 4},   {"repeated", 4},
                                               {"rejected", 4}, {"sample", 8}, {"fingerprint", 4},
                                               {"boot", 4},     {"host", 4},   {"session", 4}};
inline constexpr std::size_t kCanStateBytes = 40;
CanFrame encode_can_state(const CanState& state) noexcept;
[[nodiscard]] bool decode_can_state(const CanFrame& frame, CanState& state) noexcept;

/// The node's text message (reason of a refusal or fault), in kCanTextParts frames.
inline constexpr std::size_t kCanTextParts = 3;
CanFrame encode_can_text(const std::string& text, std::size_t part, std::uint8_t run) noexcept;
[[nodiscard]] bool decode_can_text(const CanFrame& frame, std::size_t& part, std::string& piece);

/// One chunk of a transfer, in either direction.
inline constexpr std::size_t kCanChunkBytes = 56;
/// Number of chunks for `bytes`.
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

/// Chunk `index` of the memory that is transferred.
CanFrame encode_can_part(std::uint16_t id, std::uint8_t token, std::size_t index,
                         std::span<const std::uint8_t> memory) noexcept;
/// @returns false without changing the memory if the chunk does not fit it
[[nodiscard]] bool take_can_part(const CanChunk& chunk, std::span<std::uint8_t> memory) noexcept;

// Little-endian words and float32 of waveforms and traces.
inline constexpr std::size_t kCanFloatBytes = 4;
void append_can_word(std::vector<std::uint8_t>& memory, std::uint32_t word);
void append_can_float(std::vector<std::uint8_t>& memory, double value);
double can_float_at(std::span<const std::uint8_t> memory, std::size_t at) noexcept;

/// Bytes of a row of a trace: all actuators and sensors, and the outcome.
inline std::size_t can_trace_row_bytes(const StageInfo& info) noexcept {
  return kCanFloatBytes * (info.actuators.size() + info.sensors.size() + 1);
}

enum class CanMemory : std::uint8_t { waveform = 0, trace = 1 };

/// The received chunks of an upload: all before `first`, then those with a set bit.
struct CanMissing {
  std::uint32_t first = 0;
  std::uint8_t token = 0;
  std::array<std::uint8_t, 48> received{};
};
inline constexpr std::uint32_t kCanMissingBits = 384;
CanFrame encode_can_missing(const CanMissing& missing) noexcept;
[[nodiscard]] bool decode_can_missing(const CanFrame& frame, CanMissing& missing) noexcept;

/// Digest of a whole transfer, FNV-1a, 64 bit. It detects misplaced chunks; bit errors are detected by the
/// CRC of each frame. Source: draft-eastlake-fnv.
std::uint64_t can_digest(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace stageid
