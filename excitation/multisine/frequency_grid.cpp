#include "excitation/multisine/frequency_grid.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "excitation/multisine/random_stream.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

constexpr bool is_odd(int line) { return line % 2 != 0; }

int highest_line(int samples_per_period) { return (samples_per_period + 1) / 2 - 1; }

void check_rate_and_period(double sample_rate_hz, int samples_per_period) {
  require(sample_rate_hz > 0.0 && std::isfinite(sample_rate_hz),
          "frequency grid: the sample rate must be positive and finite; got {} Hz", sample_rate_hz);
  require(samples_per_period >= 3, "frequency grid: a period must have at least 3 samples; got {}",
          samples_per_period);
}

void check_band(double sample_rate_hz, const LineSpec& spec) {
  require(std::isfinite(spec.low_hz) && std::isfinite(spec.high_hz) && spec.low_hz >= 0.0,
          "frequency band: invalid limits {} to {} Hz; both must be finite and nonnegative",
          spec.low_hz, spec.high_hz);
  require(spec.low_hz <= spec.high_hz,
          "frequency band: {} to {} Hz is reversed; low_hz must not exceed high_hz", spec.low_hz,
          spec.high_hz);
  require(spec.high_hz < sample_rate_hz / 2.0,
          "frequency band: {} Hz is at or above half the sample rate; high_hz must be below {} Hz",
          spec.high_hz, sample_rate_hz / 2.0);
  require(spec.selection != LineSelection::odd_random || spec.group_size >= 2,
          "frequency band: a group must have at least 2 odd lines; got {}", spec.group_size);
}

/// Omits one line of every complete group; an incomplete last group remains whole.
std::vector<int> leave_out_at_random(const std::vector<int>& odd_lines, const LineSpec& spec) {
  const auto group = static_cast<std::size_t>(spec.group_size);
  const std::size_t complete = odd_lines.size() - odd_lines.size() % group;
  UniformStream random(stream_seed(spec.seed, 0, 0));
  std::vector<int> kept;
  for (std::size_t first = 0; first < odd_lines.size(); first += group) {
    const std::size_t end = std::min(first + group, odd_lines.size());
    const std::size_t left_out =
        first < complete ? first + static_cast<std::size_t>(random.next() * spec.group_size) : end;
    for (std::size_t i = first; i < end; ++i) {
      if (i != left_out) kept.push_back(odd_lines[i]);
    }
  }
  return kept;
}

}  // namespace

FrequencyGrid::FrequencyGrid(double sample_rate_hz, int samples_per_period, std::vector<int> lines)
    : sample_rate_hz_(sample_rate_hz),
      samples_per_period_(samples_per_period),
      lines_(std::move(lines)) {
  check_rate_and_period(sample_rate_hz, samples_per_period);
  require(!lines_.empty(), "frequency grid: at least one line is required");
  require(std::ranges::adjacent_find(lines_, std::greater_equal<>()) == lines_.end(),
          "frequency grid: the lines must be strictly increasing");
  require(
      lines_.front() >= 1 && lines_.back() <= highest_line(samples_per_period),
      "frequency grid: lines {} to {} are out of range; use 1 to {} (zero frequency and half the "
      "sample rate are excluded) for a period of {} samples",
      lines_.front(), lines_.back(), highest_line(samples_per_period), samples_per_period);
}

FrequencyGrid FrequencyGrid::band(double sample_rate_hz, int samples_per_period,
                                  const LineSpec& spec) {
  check_rate_and_period(sample_rate_hz, samples_per_period);
  check_band(sample_rate_hz, spec);

  // A band edge of exactly one line in decimal notation must count as that line, although 0.3 Hz / 0.1 Hz < 3
  // in binary. A billionth of the line number is far above rounding and far below the line spacing.
  constexpr double kRounding = 1e-9;
  const double lines_per_hz = samples_per_period / sample_rate_hz;
  const int first =
      std::max(1, static_cast<int>(std::ceil(spec.low_hz * lines_per_hz * (1.0 - kRounding))));
  const int last =
      std::min(highest_line(samples_per_period),
               static_cast<int>(std::floor(spec.high_hz * lines_per_hz * (1.0 + kRounding))));

  const bool odd_only = spec.selection != LineSelection::all;
  std::vector<int> lines;
  for (int line = first; line <= last; ++line) {
    if (!odd_only || is_odd(line)) lines.push_back(line);
  }
  require(!lines.empty(),
          "frequency band: no {}line between {} and {} Hz; the line spacing is {} Hz. Widen the "
          "band or lengthen the period",
          odd_only ? "odd " : "", spec.low_hz, spec.high_hz, 1.0 / lines_per_hz);
  if (spec.selection == LineSelection::odd_random) lines = leave_out_at_random(lines, spec);
  return {sample_rate_hz, samples_per_period, std::move(lines)};
}

Eigen::VectorXd FrequencyGrid::frequency_hz() const {
  Eigen::VectorXd frequency(size());
  // Not line * resolution_hz(): one rounding instead of two.
  for (Eigen::Index k = 0; k < size(); ++k) {
    frequency[k] = lines_[k] * sample_rate_hz_ / samples_per_period_;
  }
  return frequency;
}

Eigen::VectorXd FrequencyGrid::omega_rad_s() const {
  return 2.0 * std::numbers::pi * frequency_hz();
}

}  // namespace stageid
