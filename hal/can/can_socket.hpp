#pragma once

#include <memory>
#include <string>
#include <vector>

#include "hal/can/can_transport.hpp"

namespace stageid {

/// SocketCAN (Linux): one raw CAN FD socket per bus, sendmmsg and recvmmsg, exact identifier filters,
/// error frames, time stamps of arrival (can_arrival.hpp).
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

/// Bus state after an error frame of the kernel. Source: linux/can/error.h.
/// @param class_bits the identifier without CAN_ERR_FLAG; @param controller byte 1 of the data.
CanBusState can_state_after_error(CanBusState before, std::uint32_t class_bits,
                                  std::uint8_t controller) noexcept;

}  // namespace stageid
