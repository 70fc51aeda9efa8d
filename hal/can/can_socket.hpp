#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

#include "hal/can/can_transport.hpp"
#include "hal/stage/sample_clock.hpp"

namespace stageid {

/// SocketCAN (Linux): one raw CAN FD socket per bus, sendmmsg and recvmmsg, exact identifier filters,
/// error frames, time stamps of arrival.
class SocketCan final : public CanTransport {
 public:
  /// Receives only frames with `identifiers`.
  /// @throws StageError naming the interface and the command that fixes it: no CAN in the kernel,
  /// unknown interface, interface down, no CAN FD (mtu below 72).
  SocketCan(const std::vector<std::string>& interfaces,
            const std::vector<std::uint16_t>& identifiers);
  ~SocketCan() override;

  std::size_t buses() const noexcept override;
  const std::string& name(std::size_t bus) const noexcept override;
  std::size_t send(std::span<const CanFrame> frames) noexcept override;
  std::size_t receive(std::span<CanFrame> frames) noexcept override;
  void wait(std::int64_t until_ns) noexcept override;
  const CanBusHealth& health(std::size_t bus) const noexcept override;

 private:
  struct Bus;
  std::vector<std::unique_ptr<Bus>> buses_;
};

/// Asks the kernel to stamp received frames, by the controller where its driver can do so. Without effect where the
/// kernel cannot: frames are then stamped when they are read.
void stamp_arrivals(int socket) noexcept;

/// Bytes of control data that a stamp needs.
inline constexpr std::size_t kArrivalControlBytes = CMSG_SPACE(3 * sizeof(timespec));

/// Converts the stamps of one socket to CLOCK_MONOTONIC. The kernel's are in CLOCK_REALTIME. Those of a controller
/// are by a clock of its own, whose offset and drift follow from both stamps of each frame; they are free of the
/// kernel's latency but for its mean.
class CanArrivals {
 public:
  /// To be called before each batch. @param now_ns CLOCK_MONOTONIC
  void begin(std::int64_t now_ns) noexcept;
  /// @return the arrival of the message with this control data, or now_ns of begin() if it has no stamp.
  std::int64_t arrival_ns(msghdr& header) noexcept;

 private:
  std::int64_t now_ns_ = 0;
  std::int64_t from_realtime_ns_ = 0;
  SampleClock controller_{1'000'000};
};

/// Bus state after an error frame of the kernel. Source: linux/can/error.h.
/// @param class_bits the identifier without CAN_ERR_FLAG; @param controller byte 1 of the data.
CanBusState can_state_after_error(CanBusState before, std::uint32_t class_bits,
                                  std::uint8_t controller) noexcept;

}  // namespace stageid
