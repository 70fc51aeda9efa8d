#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "excitation/words/words.hpp"
#include "hal/can/can_frame.hpp"
#include "hal/stage/pacer.hpp"

namespace stageid {

/// Bus state of a controller, the worst last.
enum class CanBusState : std::uint8_t { active, warning, passive, off, down };
template <>
inline constexpr std::array kWords<CanBusState> = {"error active", "error warning", "error passive",
                                                   "bus off", "interface down"};

struct CanBusHealth {
  CanBusState state = CanBusState::active;
  std::uint64_t error_frames = 0;
  std::uint64_t send_refused = 0;  ///< frames refused by a full queue (the bus is too slow)
};

/// Largest number of frames per receive().
inline constexpr std::size_t kCanInboxFrames = 64;

/// One end of one or more CAN FD buses, and their clock. After construction, nothing here allocates, locks
/// or throws.
class CanTransport {
 public:
  virtual ~CanTransport() = default;
  virtual std::size_t buses() const noexcept = 0;
  virtual const std::string& name(std::size_t bus) const noexcept = 0;

  /// Sends every frame on its bus, in order. Frames that a bus does not accept at once are discarded, because
  /// old setpoints are useless. @returns the number accepted.
  virtual std::size_t send(std::span<const CanFrame> frames) noexcept = 0;
  /// Reads received frames, oldest first within a bus; does not wait. @returns their number.
  virtual std::size_t receive(std::span<CanFrame> frames) noexcept = 0;
  /// Returns when frames or changes may be available, or at `until_ns` of now_ns().
  virtual void wait(std::int64_t until_ns) noexcept = 0;

  virtual const CanBusHealth& health(std::size_t bus) const noexcept = 0;
  virtual std::int64_t now_ns() const noexcept { return monotonic_ns(); }
};

/// A transport through another one. Derived classes change what they want.
class CanThrough : public CanTransport {
 public:
  explicit CanThrough(CanTransport& inner) noexcept : inner_(inner) {}
  std::size_t buses() const noexcept override { return inner_.buses(); }
  const std::string& name(std::size_t bus) const noexcept override { return inner_.name(bus); }
  std::size_t send(std::span<const CanFrame> frames) noexcept override {
    return inner_.send(frames);
  }
  std::size_t receive(std::span<CanFrame> frames) noexcept override {
    return inner_.receive(frames);
  }
  void wait(std::int64_t until_ns) noexcept override { inner_.wait(until_ns); }
  const CanBusHealth& health(std::size_t bus) const noexcept override { return inner_.health(bus); }
  std::int64_t now_ns() const noexcept override { return inner_.now_ns(); }

 private:
  CanTransport& inner_;
};

/// The worst state of all buses, and which bus.
struct WorstBus {
  CanBusState state = CanBusState::active;
  std::size_t bus = 0;
};
inline WorstBus worst_bus(const CanTransport& transport) noexcept {
  WorstBus worst;
  for (std::size_t bus = 0; bus < transport.buses(); ++bus)
    if (transport.health(bus).state > worst.state) worst = {transport.health(bus).state, bus};
  return worst;
}

}  // namespace stageid
