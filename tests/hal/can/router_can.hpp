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
#include "hal/can/can_zeromq.hpp"

namespace stageid::test {

/// The node's end of a bus over ZeroMQ: a ROUTER that sends every frame to the last host that gave a command.
class RouterCan final : public CanTransport {
 public:
  explicit RouterCan(std::string endpoint) : endpoint_(std::move(endpoint)), socket_(ZMQ_ROUTER) {
    if (zmq_bind(socket_.get(), endpoint_.c_str()) != 0) health_.state = CanBusState::down;
  }

  std::size_t buses() const noexcept override { return 1; }
  const std::string& name(std::size_t /*bus*/) const noexcept override { return endpoint_; }
  std::size_t send(std::span<const CanFrame> frames) noexcept override {
    std::size_t sent = 0;
    for (const CanFrame& frame : frames) {
      const ZeroMqMessage message = to_message(frame);
      if (zmq_send(socket_.get(), host_.data(), host_.size(), ZMQ_SNDMORE | ZMQ_DONTWAIT) < 0 ||
          zmq_send(socket_.get(), message.data(), message.size(), ZMQ_DONTWAIT) < 0)
        break;
      ++sent;
    }
    return sent;
  }
  std::size_t receive(std::span<CanFrame> frames) noexcept override {
    std::size_t count = 0;
    std::array<char, 64> from{};
    ZeroMqMessage message{};
    while (count < frames.size()) {
      const int bytes = zmq_recv(socket_.get(), from.data(), from.size(), ZMQ_DONTWAIT);
      if (bytes < 0 || zmq_recv(socket_.get(), message.data(), message.size(), ZMQ_DONTWAIT) < 0)
        break;
      CanFrame& frame = frames[count];
      if (!to_frame(message, frame)) continue;
      ++count;
      frame.t_rx_ns = now_ns();
      if (frame.id == kCanCommandId) host_.assign(from.begin(), from.begin() + bytes);
    }
    return count;
  }
  void wait(std::int64_t until_ns) noexcept override {
    zmq_pollitem_t item{socket_.get(), 0, ZMQ_POLLIN, 0};
    zmq_poll(&item, 1,
             static_cast<long>(std::max<std::int64_t>(0, until_ns - now_ns()) / 1'000'000));
  }
  const CanBusHealth& health(std::size_t /*bus*/) const noexcept override { return health_; }

 private:
  std::string endpoint_;
  ZeroMqSocket socket_;
  std::vector<char> host_;
  CanBusHealth health_;
};

}  // namespace stageid::test
