#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "excitation/words/words.hpp"

namespace stageid {

/// Which lines of the DFT of one period are excited.
enum class LineSelection : std::uint8_t {
  all,        ///< every line of the band
  odd,        ///< 1, 3, 5, ...: the empty even lines detect even-order nonlinearity
  odd_random  ///< odd, with one random line omitted per group: detects odd order too
};
template <>
inline constexpr std::array kWords<LineSelection> = {"all", "odd", "odd_random"};

/// Arguments of FrequencyGrid::band(), which checks them.
struct LineSpec {
  double low_hz = 0.0;   ///< first frequency, inclusive
  double high_hz = 0.0;  ///< last frequency, inclusive
  LineSelection selection = LineSelection::odd;
  int group_size = 4;      ///< odd_random: one of this many odd lines is omitted
  std::uint64_t seed = 0;  ///< odd_random: selects the omitted lines
};

/// The lines of one period of a periodic measurement. All conversions between samples, lines, Hz and
/// rad/s are here.
///
/// Line l of a period of N samples at sample rate fs has the frequency l fs / N. Invariant: lines
/// strictly increase and are in 1 .. ceil(N/2)-1 (DC and Nyquist are excluded).
class FrequencyGrid {
 public:
  /// @throws std::invalid_argument if the invariant does not hold or the rate is not positive.
  FrequencyGrid(double sample_rate_hz, int samples_per_period, std::vector<int> lines);

  /// The lines of a band according to `spec`.
  /// @throws std::invalid_argument if the band is empty, reversed, or reaches Nyquist.
  static FrequencyGrid band(double sample_rate_hz, int samples_per_period, const LineSpec& spec);

  double sample_rate_hz() const noexcept { return sample_rate_hz_; }
  int samples_per_period() const noexcept { return samples_per_period_; }
  double resolution_hz() const noexcept { return sample_rate_hz_ / samples_per_period_; }
  double period_s() const noexcept { return samples_per_period_ / sample_rate_hz_; }
  Eigen::Index size() const noexcept { return std::ssize(lines_); }
  const std::vector<int>& lines() const noexcept { return lines_; }
  Eigen::VectorXd frequency_hz() const;  ///< size()
  Eigen::VectorXd omega_rad_s() const;   ///< size()

  friend bool operator==(const FrequencyGrid&, const FrequencyGrid&) = default;

 private:
  double sample_rate_hz_;
  int samples_per_period_;
  std::vector<int> lines_;
};

}  // namespace stageid
