#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace stageid {

/// Periods of one run that are compared with each other.
struct ComparedPeriods {
  std::span<const Eigen::MatrixXcd> spectra;  ///< channels x lines (more columns are ignored)
  std::span<const Eigen::MatrixXf> samples;   ///< samples x channels, less what all have in common
  std::span<const int> number;                ///< of each in the run, ascending
  Eigen::VectorXd frequency_hz;               ///< of the lines, increasing
  double sample_rate_hz = 0.0;
};

/// A period that does not belong with the others.
struct PeriodOutlier {
  std::size_t period = 0;    ///< position in the span given
  Eigen::Index channel = 0;  ///< where it stands out most,
  double low_hz = 0.0;       ///< in this octave
  double high_hz = 0.0;
  double ratio = 0.0;  ///< its power of scatter over that of the others there
};

/// How often a clean run loses a period by chance, at most.
inline constexpr double kDropByChance = 1e-3;

/// Finds periods with a glitch, a bump or a transient in them, in ascending order.
///
/// In each channel the periods that lie closest together, more than half, are the core; the next
/// closest joins it as long as this costs the mean less than to leave it out. A period with g times
/// the core's noise makes the variance of the mean of n + 1 periods (n + g) / (n + 1)^2, without it
/// it is 1 / n: it is worth dropping above g = 2 + 1 / n. g is the mean over octaves of the lines.
///
/// What is worth dropping must also be no chance. On the lines that cannot be told: what slow noise
/// is at the ends of a period leaks into all lines at once, and one random number would count as
/// many. So the record is divided into octaves in time (octave_records()), where nothing leaks, and
/// in some octave the power of the period over that of the core must have a probability below
/// kDropByChance over the number of channels, octaves and ways to choose the core and the period. For Gaussian noise it is F
/// distributed, with degrees of freedom from the core's own spectrum S,
///   nu = (sum S)^2 / sum S^2  over its lines of both signs,
/// of one period where S is smoothed to its resolution, and of the core.
/// It takes three periods: of two nobody knows which is wrong.
/// Source: Satterthwaite, Biometrics Bulletin 2 (1946) 110.
std::vector<PeriodOutlier> find_outliers(const ComparedPeriods& periods);

}  // namespace stageid
