#include "hal/can/can_socket.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>

#include "excitation/words/require.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {
namespace {

constexpr std::size_t kBatch = 32;
constexpr std::size_t kLargestBusCount = 16;
constexpr std::int64_t kPlausible_ns =
    1'000'000'000;  // from arrival to reading, else the clock was set

std::int64_t nanoseconds(const timespec& time) noexcept {
  return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
}

bool is_down(int error) { return error == ENETDOWN || error == ENXIO || error == ENODEV; }

int open_socket(const std::string& interface) {
  const int fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  require<StageError>(
      fd >= 0, "can: {}: cannot open a CAN socket ({}); load the kernel modules can and can_raw",
      interface, std::strerror(errno));
  return fd;
}

void bind_to(int fd, const std::string& interface) {
  ifreq request{};
  std::strncpy(request.ifr_name, interface.c_str(), IFNAMSIZ - 1);
  require<StageError>(ioctl(fd, SIOCGIFINDEX, &request) == 0,
                      "can: {}: unknown interface; 'ip link' lists all interfaces", interface);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  const bool knows_mtu = ioctl(fd, SIOCGIFMTU, &request) == 0;
  require<StageError>(!knows_mtu || request.ifr_mtu >= static_cast<int>(CANFD_MTU),
                      "can: {}: the interface does not support CAN FD (mtu {}); run 'ip link set "
                      "{} mtu 72', or set 'fd on'",
                      interface, request.ifr_mtu, interface);
  require<StageError>(ioctl(fd, SIOCGIFFLAGS, &request) != 0 || (request.ifr_flags & IFF_UP) != 0,
                      "can: {}: the interface is down; run 'ip link set {} up'", interface,
                      interface);
  const int bound = bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
  require<StageError>(bound == 0, "can: {}: cannot be bound: {}", interface, std::strerror(errno));
}

void configure(int fd, const std::string& interface,
               const std::vector<std::uint16_t>& identifiers) {
  const int on = 1;
  const can_err_mask_t errors = CAN_ERR_MASK;
  std::vector<can_filter> filters;
  for (const std::uint16_t id : identifiers)
    filters.push_back({id, CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG});
  const auto bytes = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  const bool configured =
      setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof(on)) == 0 &&
      setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), bytes) == 0 &&
      setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof(errors)) == 0;
  require<StageError>(configured, "can: {}: cannot be configured: {}", interface,
                      std::strerror(errno));
  stamp_arrivals(fd);
}

canfd_frame to_kernel(const CanFrame& frame) noexcept {
  canfd_frame raw{};
  raw.can_id = frame.id;
  raw.len = frame.length;
  raw.flags = CANFD_BRS;
  std::copy_n(frame.data.begin(), frame.length, raw.data);
  return raw;
}

}  // namespace

void stamp_arrivals(int socket) noexcept {
  const int flags = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE |
                    SOF_TIMESTAMPING_RX_HARDWARE | SOF_TIMESTAMPING_RAW_HARDWARE;
  static_cast<void>(setsockopt(socket, SOL_SOCKET, SO_TIMESTAMPING, &flags, sizeof flags));
}

void CanArrivals::begin(std::int64_t now_ns) noexcept {
  timespec realtime{};
  clock_gettime(CLOCK_REALTIME, &realtime);
  now_ns_ = now_ns;
  from_realtime_ns_ = now_ns - nanoseconds(realtime);
}

std::int64_t CanArrivals::arrival_ns(msghdr& header) noexcept {
  for (cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr; c = CMSG_NXTHDR(&header, c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SO_TIMESTAMPING) continue;
    std::array<timespec, 3> stamps{};  // kernel, unused, controller
    std::memcpy(stamps.data(), CMSG_DATA(c), sizeof stamps);
    const std::int64_t kernel = nanoseconds(stamps[0]);
    const std::int64_t controller = nanoseconds(stamps[2]);
    if (kernel == 0) break;
    const std::int64_t arrival = kernel + from_realtime_ns_;
    if (std::abs(arrival - now_ns_) > kPlausible_ns) break;
    if (controller == 0) return arrival;
    static_cast<void>(controller_.take(controller, arrival));
    return controller_.stamp_ns(controller);
  }
  return now_ns_;
}

struct SocketCan::Bus {
  explicit Bus(std::string name) : interface(std::move(name)), fd(open_socket(interface)) {}
  ~Bus() { close(fd); }
  Bus(Bus&&) = delete;

  // @returns false for an error frame: it updates the bus state and has no data.
  bool take(const canfd_frame& raw, CanFrame& frame) noexcept {
    if ((raw.can_id & CAN_ERR_FLAG) != 0) {
      ++health.error_frames;
      health.state = can_state_after_error(health.state, raw.can_id & CAN_ERR_MASK, raw.data[1]);
      return false;
    }
    frame.id = static_cast<std::uint16_t>(raw.can_id & CAN_SFF_MASK);
    frame.length = std::min<std::uint8_t>(raw.len, sizeof(raw.data));
    std::copy_n(raw.data, frame.length, frame.data.begin());
    return true;
  }

  std::size_t send(std::span<const CanFrame> frames) noexcept {
    canfd_frame raw[kBatch];
    iovec part[kBatch];
    mmsghdr message[kBatch]{};
    for (std::size_t i = 0; i < frames.size(); ++i) {
      raw[i] = to_kernel(frames[i]);
      part[i] = {&raw[i], sizeof(raw[i])};
      message[i].msg_hdr.msg_iov = &part[i];
      message[i].msg_hdr.msg_iovlen = 1;
    }
    std::size_t sent = 0;
    while (sent < frames.size()) {
      const int n = sendmmsg(fd, message + sent, static_cast<unsigned>(frames.size() - sent), 0);
      if (n <= 0) {
        if (n < 0 && errno == EINTR) continue;
        if (n < 0 && is_down(errno)) health.state = CanBusState::down;
        health.send_refused += frames.size() - sent;
        break;
      }
      sent += static_cast<std::size_t>(n);
      if (health.state == CanBusState::down) health.state = CanBusState::active;
    }
    return sent;
  }

  std::size_t receive(std::span<CanFrame> frames, std::uint8_t number, std::int64_t now) noexcept {
    canfd_frame raw[kBatch];
    iovec part[kBatch];
    mmsghdr message[kBatch]{};
    alignas(cmsghdr) char control[kBatch][kArrivalControlBytes];
    std::size_t count = 0;
    arrivals.begin(now);
    while (count < frames.size()) {
      const std::size_t asked = std::min(kBatch, frames.size() - count);
      for (std::size_t i = 0; i < asked; ++i) {
        part[i] = {&raw[i], sizeof(raw[i])};
        message[i].msg_hdr = {};
        message[i].msg_hdr.msg_iov = &part[i];
        message[i].msg_hdr.msg_iovlen = 1;
        message[i].msg_hdr.msg_control = control[i];
        message[i].msg_hdr.msg_controllen = sizeof(control[i]);
      }
      const int n = recvmmsg(fd, message, static_cast<unsigned>(asked), MSG_DONTWAIT, nullptr);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0 && is_down(errno)) health.state = CanBusState::down;
      if (n <= 0) break;
      for (int i = 0; i < n; ++i) {
        frames[count].bus = number;
        frames[count].t_rx_ns = arrivals.arrival_ns(message[i].msg_hdr);
        if (take(raw[i], frames[count])) ++count;
      }
      if (static_cast<std::size_t>(n) < asked) break;
    }
    return count;
  }

  std::string interface;
  int fd;
  CanBusHealth health;
  CanArrivals arrivals;
};

SocketCan::SocketCan(const std::vector<std::string>& interfaces,
                     const std::vector<std::uint16_t>& identifiers) {
  require<StageError>(!interfaces.empty() && interfaces.size() <= kLargestBusCount,
                      "can: {} interfaces are unsupported; give 1 to {}", interfaces.size(),
                      kLargestBusCount);
  for (const std::string& interface : interfaces) {
    buses_.push_back(std::make_unique<Bus>(interface));
    configure(buses_.back()->fd, interface, identifiers);
    bind_to(buses_.back()->fd, interface);
  }
}

SocketCan::~SocketCan() = default;

std::size_t SocketCan::buses() const noexcept { return buses_.size(); }
const std::string& SocketCan::name(std::size_t bus) const noexcept {
  return buses_[bus]->interface;
}
const CanBusHealth& SocketCan::health(std::size_t bus) const noexcept {
  return buses_[bus]->health;
}

std::size_t SocketCan::send(std::span<const CanFrame> frames) noexcept {
  std::size_t sent = 0;
  for (std::size_t first = 0; first < frames.size();) {
    std::size_t last = first + 1;  // consecutive frames of one bus share a system call
    while (last < frames.size() && frames[last].bus == frames[first].bus && last - first < kBatch)
      ++last;
    if (frames[first].bus < buses_.size())
      sent += buses_[frames[first].bus]->send(frames.subspan(first, last - first));
    first = last;
  }
  return sent;
}

std::size_t SocketCan::receive(std::span<CanFrame> frames) noexcept {
  std::size_t count = 0;
  const std::int64_t now = now_ns();
  for (std::size_t bus = 0; bus < buses_.size(); ++bus)
    count += buses_[bus]->receive(frames.subspan(count), static_cast<std::uint8_t>(bus), now);
  return count;
}

void SocketCan::wait(std::int64_t until_ns) noexcept {
  pollfd fds[kLargestBusCount];
  for (std::size_t i = 0; i < buses_.size(); ++i) fds[i] = {buses_[i]->fd, POLLIN, 0};
  const std::int64_t left = std::max<std::int64_t>(0, until_ns - now_ns());
  const timespec time{static_cast<std::time_t>(left / 1'000'000'000),
                      static_cast<long>(left % 1'000'000'000)};
  static_cast<void>(ppoll(fds, static_cast<nfds_t>(buses_.size()), &time, nullptr));
}

CanBusState can_state_after_error(CanBusState before, std::uint32_t class_bits,
                                  std::uint8_t controller) noexcept {
  if ((class_bits & CAN_ERR_BUSOFF) != 0) return CanBusState::off;
  if ((class_bits & CAN_ERR_RESTARTED) != 0) return CanBusState::active;
  if ((class_bits & CAN_ERR_CRTL) == 0) return before;
  if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0)
    return CanBusState::passive;
  if ((controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0)
    return CanBusState::warning;
  if ((controller & CAN_ERR_CRTL_ACTIVE) != 0) return CanBusState::active;
  return before;
}

}  // namespace stageid
