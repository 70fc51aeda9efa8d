#pragma once

#include <zmq.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "hal/can/can_layout.hpp"
#include "hal/can/can_transport.hpp"

namespace stageid::test {

/// The node's end of a bus over ZeroMQ: a ROUTER that sends every frame to the last host that gave a command.
class RouterCan final : public CanTransport {
 public:
  explicit RouterCan(std::string endpoint)
      : endpoint_(std::move(endpoint)),
        context_(zmq_ctx_new()),
        socket_(zmq_socket(context_, ZMQ_ROUTER)) {
    const int none = 0;
    zmq_setsockopt(socket_, ZMQ_LINGER, &none, sizeof(none));
    if (zmq_bind(socket_, endpoint_.c_str()) != 0) health_.state = CanBusState::down;
  }
  ~RouterCan() override {
    zmq_close(socket_);
    zmq_ctx_term(context_);
  }
  RouterCan(const RouterCan&) = delete;
  RouterCan& operator=(const RouterCan&) = delete;

  std::size_t buses() const noexcept override { return 1; }
  const std::string& name(std::size_t /*bus*/) const noexcept override { return endpoint_; }
  std::size_t send(std::span<const CanFrame> frames) noexcept override {
    std::size_t sent = 0;
    for (const CanFrame& frame : frames) {
      Message message{};
      message[0] = static_cast<std::uint8_t>(frame.id);
      message[1] = static_cast<std::uint8_t>(frame.id >> 8);
      message[2] = frame.length;
      std::copy(frame.data.begin(), frame.data.end(), message.begin() + kHead);
      if (zmq_send(socket_, host_.data(), host_.size(), ZMQ_SNDMORE | ZMQ_DONTWAIT) < 0 ||
          zmq_send(socket_, message.data(), message.size(), ZMQ_DONTWAIT) < 0)
        break;
      ++sent;
    }
    return sent;
  }
  std::size_t receive(std::span<CanFrame> frames) noexcept override {
    std::size_t count = 0;
    std::array<char, 64> from{};
    Message message{};
    while (count < frames.size()) {
      const int bytes = zmq_recv(socket_, from.data(), from.size(), ZMQ_DONTWAIT);
      if (bytes < 0 || zmq_recv(socket_, message.data(), message.size(), ZMQ_DONTWAIT) < 0) break;
      CanFrame& frame = frames[count++];
      frame.id = static_cast<std::uint16_t>(message[0] | message[1] << 8);
      frame.bus = 0;
      frame.length = message[2];
      std::copy(message.begin() + kHead, message.end(), frame.data.begin());
      frame.t_rx_ns = now_ns();
      if (frame.id == kCanCommandId) host_.assign(from.begin(), from.begin() + bytes);
    }
    return count;
  }
  void wait(std::int64_t until_ns) noexcept override {
    zmq_pollitem_t item{socket_, 0, ZMQ_POLLIN, 0};
    zmq_poll(&item, 1,
             static_cast<long>(std::max<std::int64_t>(0, until_ns - now_ns()) / 1'000'000));
  }
  const CanBusHealth& health(std::size_t /*bus*/) const noexcept override { return health_; }

 private:
  static constexpr std::size_t kHead = 8;
  using Message = std::array<std::uint8_t, kHead + 64>;

  std::string endpoint_;
  void* context_;
  void* socket_;
  std::vector<char> host_;
  CanBusHealth health_;
};

}  // namespace stageid::test
