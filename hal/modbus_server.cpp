#include "hal/modbus_server.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <modbus/modbus.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "hal/modbus_context.hpp"
#include "hal/modbus_frame.hpp"
#include "hal/pacer.hpp"
#include "hal/stage.hpp"

namespace stageid {
namespace {

constexpr std::size_t kMostBuffered = 4096;
constexpr int kBacklog = 4;

constexpr std::int64_t kSilence_ns = ModbusServer::kSilence_ms * std::int64_t{1'000'000};

int bound_port(int listener) {
  sockaddr_in name{};
  socklen_t size = sizeof name;
  if (getsockname(listener, reinterpret_cast<sockaddr*>(&name), &size) != 0) return 0;
  return ntohs(name.sin_port);
}

}  // namespace

struct ModbusServer::Line {
  int descriptor = -1;
  std::vector<std::uint8_t> received;
  std::int64_t last_byte_ns = 0;
  bool broken = false;  // serial: not before the next silence
  bool closed = false;
};

struct ModbusServer::Context {
  ModbusContext modbus;
};

ModbusServer::ModbusServer(const ModbusAddress& address, ModbusRegisters& registers,
                           ModbusFaultScript* faults)
    : address_(address),
      registers_(registers),
      faults_(faults),
      context_(std::make_unique<Context>(Context{make_modbus_context(address)})) {
  open();
}

ModbusServer::~ModbusServer() {
  for (const Line& line : lines_)
    if (!address_.serial()) close(line.descriptor);
  if (listener_ >= 0) close(listener_);
}

void ModbusServer::open() {
  modbus_t* modbus = context_->modbus.get();
  if (address_.serial()) {
    if (modbus_connect(modbus) != 0)
      throw StageError(
          fmt::format("{}: cannot be opened: {}", to_string(address_), modbus_strerror(errno)));
    lines_.push_back({modbus_get_socket(modbus), {}, monotonic_ns()});
    return;
  }
  listener_ = modbus_tcp_listen(modbus, kBacklog);
  if (listener_ < 0)
    throw StageError(fmt::format("{}: cannot listen: {}; give another port", to_string(address_),
                                 std::strerror(errno)));
  address_.port = bound_port(listener_);
}

const ModbusFault* ModbusServer::fault(ModbusFault::Kind kind) const noexcept {
  return faults_ == nullptr ? nullptr : faults_->active(kind);
}

void ModbusServer::run(const std::atomic<bool>& stop) {
  constexpr int kLookAround_ms = 5;
  while (!stop.load(std::memory_order_relaxed)) serve(kLookAround_ms);
}

void ModbusServer::serve(int wait_ms) {
  serve_lines(wait_ms);
  registers_.tick();
}

void ModbusServer::serve_lines(int wait_ms) {
  std::vector<pollfd> waiting;
  for (const Line& line : lines_) waiting.push_back({line.descriptor, POLLIN, 0});
  if (listener_ >= 0) waiting.push_back({listener_, POLLIN, 0});
  if (dead_ || waiting.empty() || poll(waiting.data(), waiting.size(), wait_ms) <= 0) {
    if (waiting.empty()) std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
    for (Line& line : lines_) forget_noise(line);
    return;
  }
  const std::size_t lines = lines_.size();
  for (std::size_t i = 0; i < lines && !dead_; ++i)
    if (waiting[i].revents != 0 && receive(lines_[i])) answer_all(lines_[i]);
  if (!dead_ && waiting.size() > lines && waiting.back().revents != 0) accept_client();
  std::erase_if(lines_, [this](const Line& line) {
    if (line.closed && !address_.serial()) close(line.descriptor);
    return line.closed;
  });
}

void ModbusServer::accept_client() {
  const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
  if (client < 0) return;
  if (lines_.size() >= kMostClients) {
    close(client);
    return;
  }
  lines_.push_back({client, {}, monotonic_ns()});
}

/// False: nothing to answer.
bool ModbusServer::receive(Line& line) {
  std::array<std::uint8_t, 512> bytes{};
  const ssize_t count = read(line.descriptor, bytes.data(), bytes.size());
  if (count <= 0) {
    // A pty whose other side is away says EIO until it is back.
    line.closed = !address_.serial() && !(count < 0 && (errno == EINTR || errno == EAGAIN));
    if (address_.serial()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return false;
  }
  forget_noise(line);
  line.last_byte_ns = monotonic_ns();
  line.received.insert(line.received.end(), bytes.begin(), bytes.begin() + count);
  if (line.received.size() > kMostBuffered) line.received.clear();
  return !line.broken;
}

void ModbusServer::forget_noise(Line& line) {
  if (!address_.serial()) return;
  if (monotonic_ns() - line.last_byte_ns < kSilence_ns) return;
  line.received.clear();
  line.broken = false;
}

void ModbusServer::answer_all(Line& line) {
  while (!line.closed && !dead_) {
    const ModbusRequest request =
        address_.serial() ? parse_rtu_request(line.received) : parse_tcp_request(line.received);
    if (request.status == FrameStatus::incomplete) return;
    if (request.status == FrameStatus::broken) {
      line.received.clear();
      line.broken = address_.serial();
      line.closed = !address_.serial();
      return;
    }
    answer(line, request.transaction, request.unit, request.pdu);
    line.received.erase(line.received.begin(),
                        line.received.begin() + static_cast<std::ptrdiff_t>(request.bytes));
  }
}

void ModbusServer::answer(Line& line, std::uint16_t transaction, std::uint8_t unit,
                          std::span<const std::uint8_t> request) {
  using Kind = ModbusFault::Kind;
  std::array<std::uint8_t, kLargestPdu> reply{};
  if (unit != static_cast<std::uint8_t>(address_.unit)) {
    if (address_.serial()) return;
    const std::size_t bytes = exception_reply(request[0], ModbusException::gateway_target, reply);
    send(line, transaction, unit, std::span(reply).first(bytes), false);
    return;
  }
  if (faults_ != nullptr) faults_->next_request();
  if (fault(Kind::dead_server) != nullptr) {
    dead_ = true;
    for (Line& other : lines_) other.closed = true;
    if (listener_ >= 0) close(std::exchange(listener_, -1));
    return;
  }
  std::size_t bytes = 0;
  if (const ModbusFault* refusal = fault(Kind::exception)) {
    bytes = exception_reply(request[0], static_cast<ModbusException>(refusal->value), reply);
  } else {
    bytes = answer_request(request, registers_, reply);
  }
  if (const ModbusFault* late = fault(Kind::late_reply))
    std::this_thread::sleep_for(std::chrono::duration<double>(late->value));
  if (fault(Kind::wrong_unit) != nullptr) {
    std::fill(reply.begin() + 2, reply.end(), std::uint8_t{0});
    ++unit;
  }
  send(line, transaction, unit, std::span(reply).first(bytes), fault(Kind::half_frame) != nullptr);
}

void ModbusServer::send(Line& line, std::uint16_t transaction, std::uint8_t unit,
                        std::span<const std::uint8_t> reply, bool half) {
  const std::vector<std::uint8_t> frame =
      address_.serial() ? rtu_frame(unit, reply) : tcp_frame(transaction, unit, reply);
  const std::size_t bytes = half ? frame.size() / 2 : frame.size();
  std::size_t sent = 0;
  while (sent < bytes) {
    const ssize_t count =
        address_.serial()
            ? write(line.descriptor, frame.data() + sent, bytes - sent)
            : ::send(line.descriptor, frame.data() + sent, bytes - sent, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      line.closed = !address_.serial();
      return;
    }
    sent += static_cast<std::size_t>(count);
  }
}

}  // namespace stageid
