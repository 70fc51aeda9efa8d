#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "frf/statistics/index_range.hpp"

namespace stageid {

/// Periods of one run to compare.
struct ComparedPeriods {
  std::span<const Eigen::MatrixXcd> spectra;  ///< channels x lines (more columns are ignored)
  std::span<const Eigen::MatrixXf> samples;   ///< samples x channels, without their common part
  std::span<const int> number;                ///< index of each in the run, ascending
  Eigen::VectorXd frequency_hz;               ///< of the lines, increasing
  double sample_rate_hz = 0.0;
};

/// A period that differs from the others by more than noise.
struct PeriodOutlier {
  std::size_t period = 0;    ///< index in the given span
  Eigen::Index channel = 0;  ///< channel with the largest deviation
  double low_hz = 0.0;       ///< octave with the largest deviation
  double high_hz = 0.0;
  double ratio = 0.0;  ///< its power there over that of the other periods
  /// The samples that deviate, of any channel, in the highest octave with a significant deviation. None: all of them.
  IndexRange where{};
};

struct PeriodOutliers {
  std::vector<PeriodOutlier> found;     ///< ascending periods
  std::vector<std::size_t> consistent;  ///< periods without a deviation in any channel, ascending
};

/// Finds periods with a glitch, a disturbance or a transient (docs/theory.md, section 3), at most (P - 1) / 2 of P.
///
/// In each channel, the closest majority of the periods is the core. The next closest period joins the core as
/// long as this reduces the variance of the mean. With n clean periods and one with g times their noise, the
/// variance is (n + g) / (n + 1)^2; without that period it is 1 / n. Dropping it reduces the variance if
/// g > 2 + 1 / n. g is the mean over octaves of the lines.
///
/// The deviation must also be significant. The lines cannot decide this: different values at the start and end of
/// a period, caused by slow noise, leak into all lines at once. The record is therefore divided into octaves in
/// time (octave_records()), without leakage. In some octave the power of the period over that of the core must
/// have a probability below 1e-3 (that a clean run loses a period), divided by the number of channels, octaves and ways to choose the core
/// and the period. For Gaussian noise the ratio is F distributed. Its degrees of freedom follow from the core's
/// spectrum S,
///   nu = (sum S)^2 / sum S^2  over its lines of both signs,
/// with S smoothed to the resolution of one period for the period, and unsmoothed for the core.
/// Three periods are needed: of two, either could be wrong.
/// Source: Satterthwaite, Biometrics Bulletin 2 (1946) 110.
PeriodOutliers find_outliers(const ComparedPeriods& periods);

}  // namespace stageid
