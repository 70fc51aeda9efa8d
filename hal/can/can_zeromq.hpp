#pragma once

#include <array>
#include <string>

#include "hal/can/can_transport.hpp"

namespace stageid {

/// Whether an interface of the group `can` is a ZeroMQ endpoint, tcp:// or ipc://, instead of a CAN interface.
bool is_zeromq(const std::string& interface) noexcept;

/// A socket of ZeroMQ with a context of its own. What is not sent at the end is old, and is dropped.
class ZeroMqSocket {
 public:
  explicit ZeroMqSocket(int type);  ///< such as ZMQ_DEALER
  ~ZeroMqSocket();
  ZeroMqSocket(ZeroMqSocket&&) = delete;

  void set(int option, int value) noexcept;
  void* get() const noexcept { return socket_; }

 private:
  void* context_;
  void* socket_;
};

/// One frame: u16 identifier, u16 length, u32 0, then 64 bytes of data, little-endian.
using ZeroMqMessage = std::array<std::uint8_t, 72>;
ZeroMqMessage to_message(const CanFrame& frame) noexcept;
/// @returns false if the length is impossible.
bool to_frame(const ZeroMqMessage& message, CanFrame& frame) noexcept;

/// The host's end of a bus whose frames are ZeroMQ messages, for rapid-prototyping controllers without CAN FD. A DEALER
/// socket that connects to the ROUTER of the node. A message is one frame.
///
/// ZeroMQ allocates and has threads of its own, so this carries resident experiments only.
class ZeroMqCan final : public CanTransport {
 public:
  /// @throws StageError if the endpoint is invalid. The node may start later: the connection is made in the background.
  explicit ZeroMqCan(std::string endpoint);

  std::size_t buses() const noexcept override { return 1; }
  const std::string& name(std::size_t /*bus*/) const noexcept override { return endpoint_; }
  std::size_t send(std::span<const CanFrame> frames) noexcept override;
  std::size_t receive(std::span<CanFrame> frames) noexcept override;
  void wait(std::int64_t until_ns) noexcept override;
  /// Messages of a wrong size are counted as `error_frames`.
  const CanBusHealth& health(std::size_t /*bus*/) const noexcept override { return health_; }

 private:
  std::string endpoint_;
  CanBusHealth health_;
  ZeroMqSocket socket_;
};

}  // namespace stageid
