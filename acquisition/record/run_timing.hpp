#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace stageid {

/// Counts of times in fixed bins: one nanosecond wide below 16 ns, then eight to every doubling, so
/// that a quantile is known to 1/8 and better. Adding neither allocates nor branches on the value.
class TimingHistogram {
 public:
  /// The last bin also holds what is longer than 2^32 ns.
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

  /// The upper edge of the bin that holds the value at `share` (0 to 1) of all, in seconds; 0 if
  /// nothing was counted.
  double quantile_s(double share) const noexcept;

  TimingHistogram& operator+=(const TimingHistogram& other) noexcept;
  friend bool operator==(const TimingHistogram&, const TimingHistogram&) = default;

 private:
  std::array<std::uint64_t, kBins> counts_{};
};

/// How a run kept time against a wall clock; empty in virtual time.
struct RunTiming {
  /// From the return of one exchange to the moment at which the next one had nothing left to do but
  /// wait: controller, limits, logging, and the plant where it is simulated.
  TimingHistogram execution;
  TimingHistogram lateness;   ///< from the sample instant to the moment the loop got hold of it
  std::uint64_t skipped = 0;  ///< whole periods left out behind late ones, to keep the phase

  bool empty() const noexcept { return lateness.total() == 0; }
  RunTiming& operator+=(const RunTiming& other) noexcept;
  friend bool operator==(const RunTiming&, const RunTiming&) = default;
};

}  // namespace stageid
