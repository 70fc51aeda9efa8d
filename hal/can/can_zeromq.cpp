#include "hal/can/can_zeromq.hpp"

#include <fmt/format.h>
#include <zmq.h>

#include <algorithm>
#include <array>
#include <utility>

#include "hal/stage/stage.hpp"

namespace stageid {
namespace {

constexpr std::size_t kHead = 8;
using Message = std::array<std::uint8_t, kHead + 64>;
constexpr int kQueue = 4096;  // messages in each direction

Message to_message(const CanFrame& frame) noexcept {
  Message message{};
  message[0] = static_cast<std::uint8_t>(frame.id);
  message[1] = static_cast<std::uint8_t>(frame.id >> 8);
  message[2] = frame.length;
  std::copy(frame.data.begin(), frame.data.end(), message.begin() + kHead);
  return message;
}

/// @returns false if the length is impossible.
bool to_frame(const Message& message, CanFrame& frame) noexcept {
  if (message[2] > 64 || message[3] != 0) return false;
  frame.id = static_cast<std::uint16_t>(message[0] | message[1] << 8);
  frame.bus = 0;
  frame.length = message[2];
  std::copy(message.begin() + kHead, message.end(), frame.data.begin());
  return true;
}

}  // namespace

struct ZeroMqCan::Socket {
  Socket() : context(zmq_ctx_new()), socket(zmq_socket(context, ZMQ_DEALER)) {}
  ~Socket() {
    zmq_close(socket);
    zmq_ctx_term(context);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  void set(int option, int value) noexcept {
    zmq_setsockopt(socket, option, &value, sizeof(value));
  }

  void* context;
  void* socket;
};

bool is_zeromq(const std::string& interface) noexcept {
  return interface.starts_with("tcp://") || interface.starts_with("ipc://");
}

ZeroMqCan::ZeroMqCan(std::string endpoint)
    : endpoint_(std::move(endpoint)), socket_(std::make_unique<Socket>()) {
  socket_->set(ZMQ_LINGER, 0);     // what is not sent at the end is old
  socket_->set(ZMQ_IMMEDIATE, 1);  // nothing waits for a node that is not there
  socket_->set(ZMQ_SNDHWM, kQueue);
  socket_->set(ZMQ_RCVHWM, kQueue);
  socket_->set(ZMQ_RECONNECT_IVL, 50);
  if (zmq_connect(socket_->socket, endpoint_.c_str()) != 0)
    throw StageError(fmt::format("can: {}: {}; write tcp://HOST:PORT or ipc://FILE", endpoint_,
                                 zmq_strerror(zmq_errno())));
}

ZeroMqCan::~ZeroMqCan() = default;

std::size_t ZeroMqCan::send(std::span<const CanFrame> frames) noexcept {
  std::size_t sent = 0;
  for (const CanFrame& frame : frames) {
    const Message message = to_message(frame);
    if (zmq_send(socket_->socket, message.data(), message.size(), ZMQ_DONTWAIT) < 0)
      ++health_.send_refused;
    else
      ++sent;
  }
  return sent;
}

std::size_t ZeroMqCan::receive(std::span<CanFrame> frames) noexcept {
  std::size_t count = 0;
  Message message;
  while (count < frames.size()) {
    const int bytes =
        zmq_recv(socket_->socket, message.data(), message.size(), ZMQ_DONTWAIT);  // the whole size
    if (bytes < 0) break;
    if (bytes != static_cast<int>(message.size()) || !to_frame(message, frames[count])) {
      ++health_.error_frames;
      continue;
    }
    frames[count].t_rx_ns = now_ns();
    ++count;
  }
  return count;
}

void ZeroMqCan::wait(std::int64_t until_ns) noexcept {
  constexpr std::int64_t kMillisecond_ns = 1'000'000;
  const std::int64_t left_ns = std::max<std::int64_t>(0, until_ns - now_ns());
  zmq_pollitem_t item{socket_->socket, 0, ZMQ_POLLIN, 0};
  zmq_poll(&item, 1, static_cast<long>((left_ns + kMillisecond_ns - 1) / kMillisecond_ns));
}

}  // namespace stageid
