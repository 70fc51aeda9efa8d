#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace stageid {

/// A period that does not belong with the others.
struct PeriodOutlier {
  std::size_t period = 0;       ///< position in the span given
  Eigen::Index channel = 0;     ///< where it stands out most,
  Eigen::Index first_line = 0;  ///< on lines first_line
  Eigen::Index last_line = 0;   ///<   ... last_line
  double ratio = 0.0;           ///< its power of scatter over that of the others there
};

/// How often a clean run loses a period by chance, at most.
inline constexpr double kDropByChance = 1e-3;

/// Finds periods with a glitch, a bump or a transient in them by their spectra, worst first.
///
/// For P periods of stationary Gaussian noise the share of period p in the scatter of a line,
///   r = |Z_p - Z|^2 / sum_q |Z_q - Z|^2  P / (P - 1),  Z the mean,  P(r > x) = (1 - x)^(P - 2),
/// whatever the noise's colour, so that -(P - 2) sum ln(1 - r) over the L lines of a band is a sum of
/// L unit exponentials. What drifts from one end of a period to the other leaks into all lines at once,
/// as 1/(j omega) where it is slow: that much of each period's deviation is taken out of every band
/// first, lest its one random number counts as L. A period is an outlier if in some channel and octave (of at least 8 lines)
/// this sum has a probability below kDropByChance over the number of such tests, and the ratio
///   (P - 2) sum r / sum (1 - r)  (1 for clean periods)
/// is above 4: what adds less costs the mean less than a period, and is in its variance. The worst
/// is taken out and the rest looked at again, as long as less than half is taken and three are left:
/// of two periods nobody knows which is wrong.
/// Source: r is a beta variable, as a share of sums of squares (Cochran).
///
/// `periods`: spectra, channels x lines (more columns are ignored); `frequency_hz`: of the lines,
/// increasing.
std::vector<PeriodOutlier> find_outliers(std::span<const Eigen::MatrixXcd> periods,
                                         const Eigen::VectorXd& frequency_hz);

}  // namespace stageid
