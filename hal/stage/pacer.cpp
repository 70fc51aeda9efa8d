#include "hal/stage/pacer.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>

namespace stageid {
namespace {

constexpr double kLongestSpin_ns = 60'000.0;  // a sleeping thread wakes up to 60 us late
// The kernel throttles a real-time thread that never sleeps: 50 ms are lost per second.
constexpr double kSpinShare = 0.6;

void sleep_until(std::int64_t t_ns) noexcept {
  const timespec until{static_cast<std::time_t>(t_ns / 1'000'000'000),
                       static_cast<long>(t_ns % 1'000'000'000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) != 0) {
  }
}

}  // namespace

std::int64_t monotonic_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

Pacer::Pacer(double sample_rate_hz, double pace) noexcept
    : period_ns_(1e9 / (pace > 0.0 ? sample_rate_hz * pace : sample_rate_hz)),
      spin_ns_(static_cast<std::int64_t>(std::min(kLongestSpin_ns, kSpinShare * period_ns_))),
      wall_(pace > 0.0) {}

Pacer::Instant Pacer::restart() noexcept {
  index_ = 0;
  origin_ns_ = wall_ ? monotonic_ns() : 0;
  return {origin_ns_, origin_ns_, 0, false};
}

Pacer::Instant Pacer::wait() noexcept {
  ++index_;
  const auto at = origin_ns_ + static_cast<std::int64_t>(static_cast<double>(index_) * period_ns_);
  if (!wall_) return {at, at, 0, false};

  std::int64_t now = monotonic_ns();
  const std::int64_t ready = now;
  if (now > at) {
    const double periods = std::floor(static_cast<double>(now - at) / period_ns_);
    origin_ns_ += static_cast<std::int64_t>(periods * period_ns_);
    return {at, now, ready, true};
  }
  if (at - now > spin_ns_) sleep_until(at - spin_ns_);
  do now = monotonic_ns();
  while (now < at);
  return {at, now, ready, false};
}

}  // namespace stageid
