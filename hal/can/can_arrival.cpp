#include "hal/can/can_arrival.hpp"

#include <linux/net_tstamp.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace stageid {
namespace {

constexpr std::int64_t kPlausible_ns =
    1'000'000'000;  // from arrival to reading, else the clock was set

std::int64_t nanoseconds(const timespec& time) noexcept {
  return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
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

}  // namespace stageid
