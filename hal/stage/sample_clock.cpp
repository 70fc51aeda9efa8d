#include "hal/stage/sample_clock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

namespace stageid {
namespace {

constexpr double kSmallestShare = 1.0 / 50.0;
constexpr double kLargestDrift = 1e-3;  // of two crystals; in a pace other than 1, of a busy host
constexpr int kJump = 3;                // irregular samples in a row
constexpr double kTolerablePhase_rad = 0.1;

}  // namespace

std::int64_t SampleClock::stamp_ns(std::int64_t expected_ns) const noexcept {
  const auto since = static_cast<double>(expected_ns - expected_ns_);
  return stamp_ns_ + (expected_ns - expected_ns_) + std::llround(drift_ * since + fraction_ns_);
}

std::int64_t SampleClock::take(std::int64_t expected_ns, std::int64_t stamp_ns) noexcept {
  const bool first = count_ == 0;
  const std::int64_t deviation = first ? 0 : stamp_ns - this->stamp_ns(expected_ns);
  const bool irregular = std::abs(deviation) > limit_ns_;
  if (irregular && ++irregular_ < kJump) return deviation;
  irregular_ = 0;
  if (first) drift_ = 0.0;
  if (first || irregular) {
    count_ = 1;
    expected_ns_ = expected_ns;
    stamp_ns_ = stamp_ns;
    fraction_ns_ = 0.0;
    return deviation;
  }
  ++count_;
  const auto pull = static_cast<double>(std::clamp(deviation, -trust_ns_, trust_ns_));
  const double share = std::max(kSmallestShare, 1.0 / count_);
  const auto since = static_cast<double>(std::max<std::int64_t>(1, expected_ns - expected_ns_));
  const double fraction = fraction_ns_ + drift_ * since + share * pull;
  const double whole = std::floor(fraction);
  stamp_ns_ += (expected_ns - expected_ns_) + static_cast<std::int64_t>(whole);
  fraction_ns_ = fraction - whole;
  expected_ns_ = expected_ns;
  drift_ = std::clamp(drift_ + 0.5 * share * share * pull / since, -kLargestDrift, kLargestDrift);
  return deviation;
}

double tolerable_jitter_s(double highest_hz) noexcept {
  return kTolerablePhase_rad / (2.0 * std::numbers::pi * highest_hz);
}

}  // namespace stageid
