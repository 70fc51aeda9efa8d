#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "hal/can/can_transport.hpp"

namespace stageid::test {

/// Passes on received frames after a function has changed them.
class AlteredCan final : public CanTransport {
 public:
  /// Receives the receiver's buffer and the number of frames; returns their new number.
  using Alter = std::function<std::size_t(std::span<CanFrame>, std::size_t)>;

  AlteredCan(CanTransport& inner, Alter alter) : inner_(inner), alter_(std::move(alter)) {}
  std::size_t buses() const noexcept override { return inner_.buses(); }
  const std::string& name(std::size_t bus) const noexcept override { return inner_.name(bus); }
  std::size_t send(std::span<const CanFrame> frames) noexcept override {
    return inner_.send(frames);
  }
  std::size_t receive(std::span<CanFrame> frames) noexcept override {
    return alter_(frames, inner_.receive(frames));
  }
  void wait(std::int64_t until_ns) noexcept override { inner_.wait(until_ns); }
  const CanBusHealth& health(std::size_t bus) const noexcept override { return inner_.health(bus); }
  std::int64_t now_ns() const noexcept override { return inner_.now_ns(); }

 private:
  CanTransport& inner_;
  Alter alter_;
};

/// Recomputes the checksum after a change.
inline void reseal(CanFrame& frame) { put_can(frame, 6, can_frame_crc(frame)); }

}  // namespace stageid::test
