#include "frf/runs/channel_scan.hpp"

#include <algorithm>
#include <cmath>

namespace stageid {
namespace {

// Samples per quick test, because few blocks contain a new extreme or a repeated value.
constexpr Eigen::Index kTogether = 256;

double log_p_of_pile(const Extreme& extreme) noexcept {
  const double n = static_cast<double>(extreme.count + extreme.next_count);
  const double share = static_cast<double>(extreme.count) / n;
  if (!(n > 0.0) || share <= 0.5) return 0.0;
  const double rest = 1.0 - share;
  const double divergence =
      std::log(2.0) + share * std::log(share) + (rest > 0.0 ? rest * std::log(rest) : 0.0);
  return -n * divergence;
}

}  // namespace

void Extreme::add(double v, std::uint64_t times) noexcept {
  if (v < next || times == 0) return;
  if (v == value) {
    count += times;
  } else if (v > value) {
    next = value;
    next_count = count;
    value = v;
    count = times;
  } else if (v == next) {
    next_count += times;
  } else {
    next = v;
    next_count = times;
  }
}

void Extreme::add(const Extreme& other) noexcept {
  add(other.value, other.count);
  add(other.next, other.next_count);
}

void ChannelScan::add(const Eigen::Ref<const Eigen::VectorXd>& samples,
                      const char* driven) noexcept {
  for (Eigen::Index first = 0; first < samples.size(); first += kTogether)
    add_some(samples.segment(first, std::min(kTogether, samples.size() - first)),
             driven != nullptr ? driven + first : nullptr);
  samples_ += static_cast<std::uint64_t>(samples.size());
  grid_.add(samples);
}

void ChannelScan::add_some(const Eigen::Ref<const Eigen::VectorXd>& samples,
                           const char* driven) noexcept {
  if (samples.maxCoeff() >= high_.next)
    for (const double v : samples) high_.add(v);
  if (-samples.minCoeff() >= low_.next)
    for (const double v : samples) low_.add(-v);
  const Eigen::Index rest = samples.size() - 1;
  const bool repeats = (stretch_ > 0 && samples[0] == last_) ||
                       (samples.head(rest).array() == samples.tail(rest).array()).any();
  if (repeats) {
    for (Eigen::Index i = 0; i < samples.size(); ++i) {
      const double v = samples[i];
      const std::uint64_t counts = driven == nullptr || driven[i] != 0 ? 1 : 0;
      const bool repeats_last = stretch_ > 0 && v == last_;
      repeating_ += !repeats_last && stretch_ > 1 ? 1 : 0;
      stretch_ = repeats_last ? stretch_ + 1 : 1;
      stretches_ += repeats_last ? 0 : 1;
      driven_ = repeats_last ? driven_ + counts : 1;
      longest_ = std::max(longest_, stretch_);
      longest_driven_ = std::max(longest_driven_, driven_);
      last_ = v;
    }
    return;
  }
  stretches_ += static_cast<std::uint64_t>(samples.size());
  repeating_ += stretch_ > 1 ? 1 : 0;
  stretch_ = driven_ = 1;
  longest_ = std::max(longest_, stretch_);
  longest_driven_ = std::max(longest_driven_, driven_);
  last_ = samples[rest];
}

void ChannelScan::add(const ChannelScan& other) noexcept {
  high_.add(other.high_);
  low_.add(other.low_);
  samples_ += other.samples_;
  grid_.add(other.grid_);
  stretches_ += other.stretches_;
  repeating_ += other.repeating_;
  longest_ = std::max(longest_, other.longest_);
  longest_driven_ = std::max(longest_driven_, other.longest_driven_);
}

Extreme ChannelScan::low() const noexcept {
  return {-low_.value, -low_.next, low_.count, low_.next_count};
}

bool ChannelScan::returns() const noexcept {
  return high_.value != low().value && std::max(high_.count, low_.count) > longest_;
}

double ChannelScan::expected_constant() const noexcept {
  if (stretches_ == 0 || stretches_ == samples_) return 1.0;
  const auto n = static_cast<double>(stretches_);
  return -std::log(n) / std::log1p(-n / static_cast<double>(samples_));
}

double ChannelScan::log_p_high() const noexcept { return log_p_of_pile(high_); }
double ChannelScan::log_p_low() const noexcept { return log_p_of_pile(low_); }

}  // namespace stageid
