#include "acquisition/record/run_timing.hpp"

#include <cmath>
#include <numeric>

namespace stageid {

std::uint64_t TimingHistogram::total() const noexcept {
  return std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0});
}

double TimingHistogram::quantile_s(double share) const noexcept {
  const std::uint64_t all = total();
  if (all == 0) return 0.0;
  const double wanted = std::ceil(share * static_cast<double>(all));
  std::uint64_t seen = 0;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    seen += counts_[bin];
    if (counts_[bin] > 0 && static_cast<double>(seen) >= wanted)
      return 1e-9 * static_cast<double>(upper_ns(bin));
  }
  return 1e-9 * static_cast<double>(upper_ns(kBins - 1));
}

TimingHistogram& TimingHistogram::operator+=(const TimingHistogram& other) noexcept {
  for (std::size_t bin = 0; bin < kBins; ++bin) counts_[bin] += other.counts_[bin];
  return *this;
}

RunTiming& RunTiming::operator+=(const RunTiming& other) noexcept {
  execution += other.execution;
  lateness += other.lateness;
  skipped += other.skipped;
  return *this;
}

}  // namespace stageid
