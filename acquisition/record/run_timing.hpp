#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace stageid {

/// Histogram of times in fixed bins: one nanosecond wide below 16 ns, then eight per octave, so that quantiles
/// have a resolution of 1/8 or better. Adding a value neither allocates nor branches on it.
class TimingHistogram {
 public:
  /// The last bin also contains values above 2^32 ns.
  static constexpr std::size_t kBins = 240;

  static constexpr std::size_t bin_of(std::uint32_t ns) noexcept {
    // v = m 2^e with m in [8, 16): bin 8 e + m. Below 16, e = 0.
    const int bits = 32 - __builtin_clz(ns | 15U);
    const auto e = static_cast<std::size_t>(bits - 4);
    return 8 * e + (ns >> e);
  }
  static constexpr std::uint64_t lower_ns(std::size_t bin) noexcept {
    if (bin < 16) return bin;
    const std::size_t e = bin / 8 - 1;
    return (bin - 8 * e) << e;
  }
  static constexpr std::uint64_t upper_ns(std::size_t bin) noexcept { return lower_ns(bin + 1); }

  void add(std::int64_t ns) noexcept {
    const std::int64_t known = ns < 0 ? 0 : ns > 0xFFFF'FFFF ? 0xFFFF'FFFF : ns;
    ++counts_[bin_of(static_cast<std::uint32_t>(known))];
  }
  void add_bin(std::size_t bin, std::uint64_t count) { counts_.at(bin) += count; }
  std::uint64_t count(std::size_t bin) const noexcept { return counts_[bin]; }
  std::uint64_t total() const noexcept;

  /// The upper edge of the bin with the quantile at `share` (0 to 1), in seconds; 0 if nothing was counted.
  double quantile_s(double share) const noexcept;

  TimingHistogram& operator+=(const TimingHistogram& other) noexcept;
  friend bool operator==(const TimingHistogram&, const TimingHistogram&) = default;

 private:
  std::array<std::uint64_t, kBins> counts_{};
};

/// Timing of a run on the wall clock; empty in virtual time.
struct RunTiming {
  /// From the return of one exchange to the start of the wait in the next one: controller, limits, logging, and the
  /// simulation of the plant if there is one.
  TimingHistogram execution;
  TimingHistogram lateness;   ///< from the sample instant until the loop received the sample
  std::uint64_t skipped = 0;  ///< whole periods skipped after late ones, to keep the phase

  bool empty() const noexcept { return lateness.total() == 0; }
  RunTiming& operator+=(const RunTiming& other) noexcept;
  friend bool operator==(const RunTiming&, const RunTiming&) = default;
};

}  // namespace stageid
