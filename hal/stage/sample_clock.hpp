#pragma once

#include <cstdint>

namespace stageid {

/// Follows the clock that stamps samples. A stamp is at offset + (1 + drift) t for a sample expected at t: the
/// offset of the two clocks and the constant delay, their drift, and the deviation of this sample (its jitter).
///
/// Every stamp corrects the offset by the share a of its deviation, and the drift by a^2/2 per sample, with
/// a = 1/n at first and 1/50 later. Deviations beyond the limit correct nothing, so that a late sample does not
/// make the next ones early. After three in a row, the clock has jumped and is followed from its new reading.
class SampleClock {
 public:
  explicit SampleClock(std::int64_t limit_ns) noexcept : SampleClock(limit_ns, limit_ns) {}
  /// A deviation beyond trust_ns corrects as one of trust_ns: many late samples do not pass for the instant of all.
  SampleClock(std::int64_t limit_ns, std::int64_t trust_ns) noexcept
      : limit_ns_(limit_ns), trust_ns_(trust_ns) {}

  void restart() noexcept { count_ = irregular_ = 0; }

  /// Takes the stamp of the next sample. @return its deviation in ns; 0 for the first.
  std::int64_t take(std::int64_t expected_ns, std::int64_t stamp_ns) noexcept;

  /// The stamp of a sample without deviation that is expected at this time. Only after the first take().
  std::int64_t stamp_ns(std::int64_t expected_ns) const noexcept;

 private:
  std::int64_t limit_ns_;
  std::int64_t trust_ns_;
  std::int64_t expected_ns_ = 0;
  std::int64_t stamp_ns_ = 0;
  double fraction_ns_ = 0.0;  // of stamp_ns_, which a double cannot hold to a nanosecond
  double drift_ = 0.0;        // seconds per second by which the stamping clock is fast
  int count_ = 0;
  int irregular_ = 0;  // in a row
};

/// The jitter at which the phase of the highest frequency deviates by 0.1 rad: the bias of a response is then below
/// 0.5 % (1 - cos 0.1), and falls with the square of the frequency.
double tolerable_jitter_s(double highest_hz) noexcept;

}  // namespace stageid
