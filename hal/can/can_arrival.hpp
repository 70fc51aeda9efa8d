#pragma once

#include <sys/socket.h>

#include <cstdint>

#include "hal/stage/sample_clock.hpp"

namespace stageid {

/// Asks the kernel to stamp received frames, by the controller where its driver can do so. Without effect where the
/// kernel cannot: frames are then stamped when they are read.
void stamp_arrivals(int socket) noexcept;

/// Bytes of control data that a stamp needs.
inline constexpr std::size_t kArrivalControlBytes = CMSG_SPACE(3 * sizeof(timespec));

/// Converts the stamps of one socket to CLOCK_MONOTONIC. The kernel's are in CLOCK_REALTIME. Those of a controller
/// are by a clock of its own, whose offset and drift follow from both stamps of each frame; they are free of the
/// kernel's latency but for its mean.
class CanArrivals {
 public:
  /// To be called before each batch. @param now_ns CLOCK_MONOTONIC
  void begin(std::int64_t now_ns) noexcept;
  /// @return the arrival of the message with this control data, or now_ns of begin() if it has no stamp.
  std::int64_t arrival_ns(msghdr& header) noexcept;

 private:
  std::int64_t now_ns_ = 0;
  std::int64_t from_realtime_ns_ = 0;
  SampleClock controller_{1'000'000};
};

}  // namespace stageid
