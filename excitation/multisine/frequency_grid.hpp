#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace stageid {

/// Which lines of the DFT of one period are excited.
enum class LineSelection : std::uint8_t {
  all,        ///< every line of the band
  odd,        ///< 1, 3, 5, ...: even lines stay empty and show even-order nonlinearity
  odd_random  ///< odd, and one odd line of every group is left out at random: shows odd order too
};

/// What to ask of FrequencyGrid::band(). Any values may stand here; band() checks them.
struct LineSpec {
  double low_hz = 0.0;   ///< first frequency, inclusive
  double high_hz = 0.0;  ///< last frequency, inclusive
  LineSelection selection = LineSelection::odd;
  int group_size = 4;      ///< odd_random: one of so many odd lines is left out
  std::uint64_t seed = 0;  ///< odd_random: which one
};

/// The lines of one period of a periodic measurement: the only place where samples, lines, Hz and
/// rad/s meet.
///
/// Line l of a period of N samples at sample rate fs has the frequency l fs / N. Invariant: the
/// lines are strictly increasing and in 1 .. ceil(N/2)-1 (never DC, never Nyquist).
class FrequencyGrid {
 public:
  /// @throws std::invalid_argument if the invariant does not hold or the rate is not positive.
  FrequencyGrid(double sample_rate_hz, int samples_per_period, std::vector<int> lines);

  /// The lines of a band by `spec`.
  /// @throws std::invalid_argument if the band is empty, reversed, or reaches Nyquist.
  static FrequencyGrid band(double sample_rate_hz, int samples_per_period, const LineSpec& spec);

  double sample_rate_hz() const noexcept { return sample_rate_hz_; }
  int samples_per_period() const noexcept { return samples_per_period_; }
  double resolution_hz() const noexcept { return sample_rate_hz_ / samples_per_period_; }
  double period_s() const noexcept { return samples_per_period_ / sample_rate_hz_; }
  Eigen::Index size() const noexcept { return static_cast<Eigen::Index>(lines_.size()); }
  const std::vector<int>& lines() const noexcept { return lines_; }
  Eigen::VectorXd frequency_hz() const;  ///< size()
  Eigen::VectorXd omega_rad_s() const;   ///< size()

  /// Lines between the first and the last excited one that are not excited: even and odd ones.
  std::vector<int> even_detection_lines() const;
  std::vector<int> odd_detection_lines() const;

  friend bool operator==(const FrequencyGrid&, const FrequencyGrid&) = default;

 private:
  double sample_rate_hz_;
  int samples_per_period_;
  std::vector<int> lines_;
};

}  // namespace stageid
