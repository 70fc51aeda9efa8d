#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace stageid {

/// What one octave of one channel does over the periods of a run.
struct OctaveRecord {
  double low_hz = 0.0;
  double high_hz = 0.0;
  /// Wavelet coefficients, positions in the period x periods; NaN where one reaches past the record.
  Eigen::MatrixXd detail;
  Eigen::Index step = 1;    ///< samples from one position to the next
  Eigen::Index begin = 0;   ///< first sample, counted from the period's, that position 0 is made of
  Eigen::Index length = 1;  ///< samples that each coefficient is made of

  /// The periods that the coefficient of one position reaches into, counted from its own.
  Eigen::Index first_period(Eigen::Index position) const;
  Eigen::Index last_period(Eigen::Index position) const;
};

/// Divides a record into octaves by Daubechies' wavelets with three vanishing moments, finest first.
///
/// Filters of finite length see the record go on from period to period, so slow noise leaks into the
/// octaves above it by its third derivative only, not by the step from a period's end to its start.
/// As long as the period has a whole number of positions every second one is kept, then all (the "a trous"
/// algorithm): what repeats in every period has the same coefficients in every period.
/// Source: Daubechies, Ten Lectures on Wavelets (1992), table 6.1.
/// @param periods  samples of one channel, one column per period
/// @param number   of each period in the run, ascending; the record is cut where one is missing
/// @param lowest_hz  octaves that end below are not returned, nor those with coefficients longer than a period
std::vector<OctaveRecord> octave_records(const Eigen::Ref<const Eigen::MatrixXd>& periods,
                                         std::span<const int> number, double sample_rate_hz,
                                         double lowest_hz);

}  // namespace stageid
