#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "hal/can/can_frame.hpp"

namespace stageid {

/// How a controller stands with its bus, the worst last.
enum class CanBusState : std::uint8_t { active, warning, passive, off, down };
const char* to_string(CanBusState state) noexcept;

struct CanBusHealth {
  CanBusState state = CanBusState::active;
  std::uint64_t error_frames = 0;
  std::uint64_t send_refused = 0;  ///< frames the queue had no room for (a bus that is too slow)
  std::uint64_t dropped = 0;       ///< frames that came faster than they were read
};

/// Frames that a receiver takes from the transport at once.
inline constexpr std::size_t kCanInboxFrames = 64;

/// One end of one or more CAN FD buses, and the clock that goes with them. Nothing here allocates,
/// locks or throws after construction.
class CanTransport {
 public:
  virtual ~CanTransport() = default;
  virtual std::size_t buses() const noexcept = 0;
  virtual const std::string& name(std::size_t bus) const noexcept = 0;

  /// Hands every frame to its bus, in order. What a bus does not take at once is lost, not kept:
  /// old setpoints are worth nothing. @returns how many were taken.
  virtual std::size_t send(std::span<const CanFrame> frames) noexcept = 0;
  /// Takes what has come in, oldest first within a bus; does not wait. @returns how many.
  virtual std::size_t receive(std::span<CanFrame> frames) noexcept = 0;
  /// Returns when something may have come in or changed, or at `until_ns` of now_ns().
  virtual void wait(std::int64_t until_ns) noexcept = 0;

  virtual const CanBusHealth& health(std::size_t bus) const noexcept = 0;
  virtual std::int64_t now_ns() const noexcept = 0;
};

/// The worst state of all buses, and which bus.
struct WorstBus {
  CanBusState state = CanBusState::active;
  std::size_t bus = 0;
};
WorstBus worst_bus(const CanTransport& transport) noexcept;

}  // namespace stageid
