#include "tools/dashboard/live_traces.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "tools/terminal/json.hpp"

namespace stageid {

LiveTraces::LiveTraces(Eigen::Index channels, double sample_rate_hz)
    : samples_per_bin_(std::max<Eigen::Index>(1, std::lround(kSeconds * sample_rate_hz / kBins))),
      bin_s_(static_cast<double>(samples_per_bin_) / sample_rate_hz),
      least_(channels),
      largest_(channels),
      low_(channels, kBins),
      high_(channels, kBins) {}

void LiveTraces::rows(std::span<const double> rows, std::size_t words) noexcept {
  for (std::size_t at = 0; at + words <= rows.size(); at += words) {
    const Eigen::Map<const Eigen::ArrayXd> row(rows.data() + at, least_.size());
    if (samples_ == 0) {
      least_ = row;
      largest_ = row;
    } else {
      least_ = least_.min(row);
      largest_ = largest_.max(row);
    }
    if (++samples_ == samples_per_bin_) finish_bin();
  }
}

/// A bin during a read is lost: the next one covers its time too.
void LiveTraces::finish_bin() noexcept {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) {
    --samples_;
    return;
  }
  low_.col(bins_ % kBins) = least_;
  high_.col(bins_ % kBins) = largest_;
  ++bins_;
  samples_ = 0;
}

std::string LiveTraces::json(Eigen::Index channel) const {
  std::vector<double> low;
  std::vector<double> high;
  if (channel >= 0 && channel < low_.rows()) {
    const std::lock_guard lock(mutex_);
    for (Eigen::Index bin = std::max<Eigen::Index>(0, bins_ - kBins); bin < bins_; ++bin) {
      low.push_back(low_(channel, bin % kBins));
      high.push_back(high_(channel, bin % kBins));
    }
  }
  return SortedJson{{"bin_s", bin_s_}, {"bins", kBins}, {"low", low}, {"high", high}}.dump();
}

}  // namespace stageid
