#include "hal/can/can_zeromq.hpp"

#include <zmq.h>

#include <algorithm>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {
namespace {

constexpr std::ptrdiff_t kHead = 8;
constexpr int kQueue = 4096;  // messages in each direction

}  // namespace

ZeroMqMessage to_message(const CanFrame& frame) noexcept {
  ZeroMqMessage message{};
  message[0] = static_cast<std::uint8_t>(frame.id);
  message[1] = static_cast<std::uint8_t>(frame.id >> 8);
  message[2] = frame.length;
  std::copy(frame.data.begin(), frame.data.end(), message.begin() + kHead);
  return message;
}

bool to_frame(const ZeroMqMessage& message, CanFrame& frame) noexcept {
  if (message[2] > 64 || message[3] != 0) return false;
  frame.id = static_cast<std::uint16_t>(message[0] | message[1] << 8);
  frame.bus = 0;
  frame.length = message[2];
  std::copy(message.begin() + kHead, message.end(), frame.data.begin());
  return true;
}

ZeroMqSocket::ZeroMqSocket(int type)
    : context_(zmq_ctx_new()), socket_(zmq_socket(context_, type)) {
  set(ZMQ_LINGER, 0);
}

ZeroMqSocket::~ZeroMqSocket() {
  zmq_close(socket_);
  zmq_ctx_term(context_);
}

void ZeroMqSocket::set(int option, int value) noexcept {
  zmq_setsockopt(socket_, option, &value, sizeof(value));
}

bool is_zeromq(const std::string& interface) noexcept {
  return interface.starts_with("tcp://") || interface.starts_with("ipc://");
}

ZeroMqCan::ZeroMqCan(std::string endpoint) : endpoint_(std::move(endpoint)), socket_(ZMQ_DEALER) {
  socket_.set(ZMQ_IMMEDIATE, 1);  // nothing waits for a node that is not there
  socket_.set(ZMQ_SNDHWM, kQueue);
  socket_.set(ZMQ_RCVHWM, kQueue);
  socket_.set(ZMQ_RECONNECT_IVL, 50);
  const bool connected = zmq_connect(socket_.get(), endpoint_.c_str()) == 0;
  require<StageError>(connected, "can: {}: {}; write tcp://HOST:PORT or ipc://FILE", endpoint_,
                      zmq_strerror(zmq_errno()));
}

std::size_t ZeroMqCan::send(std::span<const CanFrame> frames) noexcept {
  std::size_t sent = 0;
  for (const CanFrame& frame : frames) {
    const ZeroMqMessage message = to_message(frame);
    if (zmq_send(socket_.get(), message.data(), message.size(), ZMQ_DONTWAIT) < 0)
      ++health_.send_refused;
    else
      ++sent;
  }
  return sent;
}

std::size_t ZeroMqCan::receive(std::span<CanFrame> frames) noexcept {
  std::size_t count = 0;
  ZeroMqMessage message;
  while (count < frames.size()) {
    const int bytes =
        zmq_recv(socket_.get(), message.data(), message.size(), ZMQ_DONTWAIT);  // the whole size
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
  zmq_pollitem_t item{socket_.get(), 0, ZMQ_POLLIN, 0};
  zmq_poll(&item, 1, static_cast<long>((left_ns + kMillisecond_ns - 1) / kMillisecond_ns));
}

}  // namespace stageid
