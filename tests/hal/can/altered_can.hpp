#pragma once

#include <functional>
#include <span>
#include <utility>

#include "hal/can/can_transport.hpp"

namespace stageid::test {

/// Passes on received frames after a function has changed them.
class AlteredCan final : public CanThrough {
 public:
  /// Receives the receiver's buffer and the number of frames; returns their new number.
  using Alter = std::function<std::size_t(std::span<CanFrame>, std::size_t)>;

  AlteredCan(CanTransport& inner, Alter alter) : CanThrough(inner), alter_(std::move(alter)) {}
  std::size_t receive(std::span<CanFrame> frames) noexcept override {
    return alter_(frames, CanThrough::receive(frames));
  }

 private:
  Alter alter_;
};

/// Recomputes the checksum after a change.
inline void reseal(CanFrame& frame) { put_can(frame, 6, can_frame_crc(frame)); }

}  // namespace stageid::test
