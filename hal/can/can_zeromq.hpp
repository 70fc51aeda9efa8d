#pragma once

#include <memory>
#include <string>

#include "hal/can/can_transport.hpp"

namespace stageid {

/// Whether an interface of the group `can` is a ZeroMQ endpoint, tcp:// or ipc://, instead of a CAN interface.
bool is_zeromq(const std::string& interface) noexcept;

/// The host's end of a bus whose frames are ZeroMQ messages, for rapid-prototyping controllers without CAN FD. A DEALER
/// socket that connects to the ROUTER of the node. A message is one frame in 72 bytes: u16 identifier, u16 length, u32
/// 0, then 64 bytes of data, little-endian.
///
/// ZeroMQ allocates and has threads of its own, so this carries resident experiments only.
class ZeroMqCan final : public CanTransport {
 public:
  /// @throws StageError if the endpoint is invalid. The node may start later: the connection is made in the background.
  explicit ZeroMqCan(std::string endpoint);
  ~ZeroMqCan() override;

  std::size_t buses() const noexcept override { return 1; }
  const std::string& name(std::size_t /*bus*/) const noexcept override { return endpoint_; }
  std::size_t send(std::span<const CanFrame> frames) noexcept override;
  std::size_t receive(std::span<CanFrame> frames) noexcept override;
  void wait(std::int64_t until_ns) noexcept override;
  /// Messages of a wrong size are counted as `error_frames`.
  const CanBusHealth& health(std::size_t /*bus*/) const noexcept override { return health_; }

 private:
  struct Socket;
  std::string endpoint_;
  CanBusHealth health_;
  std::unique_ptr<Socket> socket_;
};

}  // namespace stageid
