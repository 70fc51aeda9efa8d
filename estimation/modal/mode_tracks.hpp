#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

namespace stageid {

/// One mode of one identification, as needed to find it again in others.
struct SeenMode {
  double frequency_hz = 0.0;
  double frequency_std_hz = 0.0;  ///< 0: unknown
  Eigen::VectorXcd shape;         ///< vec(output_shape input_shape^T), norm one; empty: unknown
  double shape_std = 0.0;         ///< root of the sum of the variances of its entries; 0: unknown
};

/// How much modes change between identifications.
struct TrackOptions {
  double drift = 2e-3;         ///< of a frequency, relative, per square root of a unit of time
  double shape_change = 0.1;   ///< of a shape of norm one
  double shape_memory = 20.0;  ///< identifications over which the shape of a track is averaged
};

/// Recognizes the modes of one identification after another. A track is one mode: its log-frequency is a random walk,
/// filtered by a scalar Kalman filter, and its shape a slowly changing mean. An identification is paired with all
/// tracks at once, by least_cost_pairs(). With the predicted deviation of the frequency in standard deviations, z, and
/// m = 1 - MAC over its variance, a pair costs
///   h(z^2) + h(4 m) + ln(variance of the prediction / its variance after one unit of time),  h(x) = 5 ln(1 + x / 4),
/// Student's t with 4 degrees of freedom: one wrong value, such as a frequency after a repair, does not end a track.
/// Modes are paired twice: the median change of all frequencies, as by temperature, is removed the second time.
/// Tracks never end; during a gap their variance grows. Modes more than 5 % apart are not paired.
class ModeTracks {
 public:
  explicit ModeTracks(const TrackOptions& options = {}) : options_(options) {}

  /// @param time not before the previous one, in any unit
  /// @return per mode its track, 0-based, in the order in which tracks began
  std::vector<std::size_t> add(double time, const std::vector<SeenMode>& modes);

  std::size_t size() const noexcept { return tracks_.size(); }
  /// The filtered frequency and the mean shape of a track.
  SeenMode mode(std::size_t track) const;

 private:
  struct Track {
    double time = 0.0;
    double log_frequency = 0.0;
    double variance = 0.0;  ///< of the log-frequency
    double count = 0.0;
    Eigen::VectorXcd shape;
  };
  double predicted_variance(const Track& track, double time) const;
  using Pairs = std::vector<std::optional<Eigen::Index>>;  // per mode its track
  double common_change(const std::vector<SeenMode>& modes, const Pairs& pairs) const;
  Eigen::MatrixXd costs(double time, const std::vector<SeenMode>& modes, double common) const;
  void update(Track& track, double time, const SeenMode& mode) const;

  TrackOptions options_;
  std::vector<Track> tracks_;
};

/// How far each value of one track differs from the median of up to 7 values before it, in standard deviations. The
/// standard deviation is that of all such differences of the track (1.48 times the median of their magnitudes),
/// combined with that of the value itself. 0 for the first 3 values. A step is noticed for about 4 values, a single
/// outlier once.
/// @param deviation standard deviations of the values; 0: unknown
std::vector<double> deviations_from_past(const std::vector<double>& values,
                                         const std::vector<double>& deviation);

}  // namespace stageid
