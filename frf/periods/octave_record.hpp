#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace stageid {

/// One octave of one channel over the periods of a run.
struct OctaveRecord {
  double low_hz = 0.0;
  double high_hz = 0.0;
  /// Wavelet coefficients, positions in the period x periods; NaN if one extends beyond the record.
  Eigen::MatrixXd detail;
  Eigen::Index step = 1;    ///< distance of the positions in samples
  Eigen::Index begin = 0;   ///< first sample of position 0, relative to the start of the period
  Eigen::Index length = 1;  ///< number of samples per coefficient

  /// First and last period of the samples of a coefficient, relative to its own.
  Eigen::Index first_period(Eigen::Index position) const;
  Eigen::Index last_period(Eigen::Index position) const;
};

/// Divides a record into octaves by Daubechies' wavelets with three vanishing moments, finest first.
///
/// The filters have finite length and continue from period to period. Slow noise therefore leaks into higher
/// octaves by its third derivative only, not by the step between the end and the start of a period. As long as
/// the period has a whole number of positions, every second one is kept, after that all (the "a trous"
/// algorithm). A periodic signal therefore has the same coefficients in every period.
/// Source: Daubechies, Ten Lectures on Wavelets (1992), table 6.1.
/// @param periods  samples of one channel, one column per period
/// @param number   of each period in the run, ascending; a missing period separates the record
/// @param lowest_hz  octaves that end below are omitted, and those with coefficients longer than a period
std::vector<OctaveRecord> octave_records(const Eigen::Ref<const Eigen::MatrixXd>& periods,
                                         std::span<const int> number, double sample_rate_hz,
                                         double lowest_hz);

}  // namespace stageid
