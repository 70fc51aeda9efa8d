#include "hal/modbus/modbus_server.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <modbus/modbus.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/stage/pacer.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {
namespace {

constexpr std::size_t kMostBuffered = 512;  // more than the longest request
constexpr int kSocketBuffer = 8192;
constexpr int kBacklog = 128;
constexpr int kAcceptedAtOnce = 64;

constexpr std::int64_t kSilence_ns = ModbusServer::kSilence_ms * std::int64_t{1'000'000};
constexpr std::int64_t kPatience_ns = ModbusServer::kPatience_ms * std::int64_t{1'000'000};

int bound_port(int listener) {
  sockaddr_in name{};
  socklen_t size = sizeof name;
  if (getsockname(listener, reinterpret_cast<sockaddr*>(&name), &size) != 0) return 0;
  return ntohs(name.sin_port);
}

}  // namespace

struct ModbusServer::Line {
  int descriptor = -1;
  ModbusConnection connection = 0;
  std::vector<std::uint8_t> received;
  std::vector<std::uint8_t> unsent;
  std::int64_t last_byte_ns = 0;
  std::int64_t last_request_ns = 0;  // 0: none yet
  std::int64_t owing_since_ns = 0;   // start of an incomplete request or unread reply
  std::int64_t not_before_ns = 0;    // end of a simulated delay of the reply
  bool more = false;                 // unprocessed bytes follow the answered request
  bool closed = false;
};

ModbusServer::ModbusServer(const ModbusAddress& address, ModbusRegisters& registers,
                           ModbusFaultScript* faults)
    : address_(address),
      registers_(registers),
      faults_(faults),
      context_(make_modbus_context(address)) {
  open();
}

ModbusServer::~ModbusServer() {
  for (const Line& line : lines_) hang_up(line);
  if (listener_ >= 0) close(listener_);
}

void ModbusServer::hang_up(const Line& line) {
  if (!address_.serial()) close(line.descriptor);
  registers_.hung_up(line.connection);
}

void ModbusServer::open() {
  modbus_t* modbus = context_.get();
  if (address_.serial()) {
    const bool opened = modbus_connect(modbus) == 0;
    require<StageError>(opened, "{}: cannot be opened: {}", to_string(address_),
                        modbus_strerror(errno));
    lines_.push_back({modbus_get_socket(modbus), ++last_connection_, {}, {}, monotonic_ns()});
    return;
  }
  listener_ = modbus_tcp_listen(modbus, kBacklog);
  require<StageError>(listener_ >= 0, "{}: cannot listen: {}; use another port",
                      to_string(address_), std::strerror(errno));
  fcntl(listener_, F_SETFL, fcntl(listener_, F_GETFL) | O_NONBLOCK);
  // The connections inherit this: clients that do not read are detected early and use little memory.
  setsockopt(listener_, SOL_SOCKET, SO_SNDBUF, &kSocketBuffer, sizeof kSocketBuffer);
  setsockopt(listener_, SOL_SOCKET, SO_RCVBUF, &kSocketBuffer, sizeof kSocketBuffer);
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
  if (dead_ || (lines_.empty() && listener_ < 0)) {
    std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
    return;
  }
  std::array<pollfd, kMostClients + 1> waiting{};
  const std::size_t lines = lines_.size();
  bool now = false;  // requests remain from the previous iteration
  for (std::size_t i = 0; i < lines; ++i) {
    const Line& line = lines_[i];
    const bool sends = !line.unsent.empty() && line.not_before_ns == 0;
    const bool receives = line.unsent.empty();
    waiting[i] = {line.descriptor,
                  static_cast<short>((sends ? POLLOUT : 0) | (receives ? POLLIN : 0)), 0};
    now |= receives && line.more;
  }
  waiting[lines] = {listener_, POLLIN, 0};  // poll() ignores a negative descriptor
  static_cast<void>(poll(waiting.data(), lines + 1, now ? 0 : wait_ms));
  for (std::size_t i = 0; i < lines && !dead_; ++i) work(lines_[i], waiting[i].revents);
  if (!dead_ && waiting[lines].revents != 0) accept_clients();
  std::erase_if(lines_, [this](const Line& line) {
    if (line.closed) hang_up(line);
    return line.closed;
  });
}

/// Serves one client once: receives at most one piece and answers at most one request.
void ModbusServer::work(Line& line, int events) {
  look_at_time(line);
  if (line.closed) return;
  if (!line.unsent.empty()) {
    if (line.not_before_ns == 0) send(line);
    return;
  }
  if (events != 0) receive(line);
  answer_next(line);
}

void ModbusServer::look_at_time(Line& line) {
  const std::int64_t now_ns = monotonic_ns();
  if (line.not_before_ns != 0 && now_ns >= line.not_before_ns) {
    line.not_before_ns = 0;
    line.owing_since_ns = now_ns;
  }
  if (address_.serial()) {
    if (now_ns - line.last_byte_ns >= kSilence_ns) line.received.clear();
    return;
  }
  const bool owes = line.not_before_ns == 0 && line.owing_since_ns != 0;
  if (owes && now_ns - line.owing_since_ns > kPatience_ns) line.closed = true;
}

void ModbusServer::accept_clients() {
  for (int i = 0; i < kAcceptedAtOnce; ++i) {
    const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (client < 0) return;
    if (lines_.size() >= kMostClients && !make_room()) {
      close(client);
      continue;
    }
    lines_.push_back({client, ++last_connection_, {}, {}, monotonic_ns()});
  }
}

/// Closes the connection with the oldest last request, preferably one without any request.
bool ModbusServer::make_room() {
  auto idle = lines_.end();
  for (auto line = lines_.begin(); line != lines_.end(); ++line)
    if (!registers_.needs(line->connection) &&
        (idle == lines_.end() || line->last_request_ns < idle->last_request_ns))
      idle = line;
  if (idle == lines_.end()) return false;
  hang_up(*idle);
  lines_.erase(idle);
  return true;
}

void ModbusServer::receive(Line& line) {
  std::array<std::uint8_t, kMostBuffered> bytes{};
  const ssize_t count = read(line.descriptor, bytes.data(), bytes.size() - line.received.size());
  if (count <= 0) {
    const bool nothing = count < 0 && (errno == EINTR || errno == EAGAIN);
    // read() on a pty returns EIO while the other side is closed.
    line.closed |= !address_.serial() && !nothing;
    if (address_.serial()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return;
  }
  line.last_byte_ns = monotonic_ns();
  line.received.insert(line.received.end(), bytes.begin(), bytes.begin() + count);
}

void ModbusServer::answer_next(Line& line) {
  if (line.closed || dead_) return;
  const ModbusRequest request =
      address_.serial() ? find_rtu_request(line.received, static_cast<std::uint8_t>(address_.unit))
                        : parse_tcp_request(line.received);
  const bool complete = request.status == FrameStatus::complete;
  if (complete) {
    line.last_request_ns = monotonic_ns();
    answer(line, request);
  }
  line.closed |= request.status == FrameStatus::broken;
  // An incomplete TCP request remains in the buffer.
  const std::size_t taken = complete || address_.serial() ? request.bytes : 0;
  line.received.erase(line.received.begin(), line.received.begin() + taken);
  line.more = complete && !line.received.empty();
  if (!line.unsent.empty()) return;
  if (line.received.empty() || line.more) {
    line.owing_since_ns = 0;
  } else if (line.owing_since_ns == 0) {
    line.owing_since_ns = line.last_byte_ns;
  }
}

void ModbusServer::answer(Line& line, ModbusRequest request) {
  using Kind = ModbusFault::Kind;
  std::array<std::uint8_t, kLargestPdu> out{};
  if (request.unit != static_cast<std::uint8_t>(address_.unit)) {
    if (address_.serial()) return;
    const std::size_t bytes = exception_reply(request.pdu[0], ModbusException::gateway_target, out);
    reply(line, request, std::span(out).first(bytes));
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
    bytes = exception_reply(request.pdu[0], static_cast<ModbusException>(refusal->value), out);
  } else {
    bytes = answer_request(request.pdu, line.connection, registers_, out);
  }
  if (fault(Kind::wrong_unit) != nullptr) {
    std::fill(out.begin() + 2, out.end(), std::uint8_t{0});
    ++request.unit;
  }
  reply(line, request, std::span(out).first(bytes));
}

void ModbusServer::reply(Line& line, const ModbusRequest& to, std::span<const std::uint8_t> pdu) {
  line.unsent =
      address_.serial() ? rtu_frame(to.unit, pdu) : tcp_frame(to.transaction, to.unit, pdu);
  line.owing_since_ns = monotonic_ns();
  if (fault(ModbusFault::Kind::half_frame) != nullptr) line.unsent.resize(line.unsent.size() / 2);
  if (const ModbusFault* late = fault(ModbusFault::Kind::late_reply)) {
    line.not_before_ns = line.owing_since_ns + std::llround(1e9 * late->value);
    return;
  }
  send(line);
}

/// What the client does not accept is sent in the next iteration.
void ModbusServer::send(Line& line) {
  const ssize_t count =
      address_.serial()
          ? write(line.descriptor, line.unsent.data(), line.unsent.size())
          : ::send(line.descriptor, line.unsent.data(), line.unsent.size(), MSG_NOSIGNAL);
  if (count < 0) {
    const bool later = errno == EINTR || errno == EAGAIN;
    line.closed |= !later && !address_.serial();
    if (!later) line.unsent.clear();
    return;
  }
  line.unsent.erase(line.unsent.begin(), line.unsent.begin() + count);
  if (line.unsent.empty()) line.owing_since_ns = 0;
}

}  // namespace stageid
