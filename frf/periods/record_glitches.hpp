#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// A period of a record with a glitch.
struct Glitch {
  int period = 0;
  Eigen::Index channel = 0;
  double ratio = 0.0;  ///< of the sample's deviation to the scatter of its neighbours
};

/// Finds glitches in a record with a transient, whose periods differ.
///
/// The difference to the next period, d[n] = x[n + N] - x[n], does not contain the excitation, and its remaining
/// transient is smooth. The second difference of d in time is therefore noise, and a glitch in period p is an
/// outlier in d of p - 1 and of p. It counts if it exceeds both sqrt(N) times and 8 times the scatter of
/// its 128 neighbours (from their median, as for normal noise; by chance in one of 1e15 samples). A smaller
/// glitch adds less than three times the noise of a period, and keeping it costs less than losing a period.
/// The next period identifies which of the two is wrong, so three periods are needed. The first 128 samples of
/// the first period are skipped, because the excitation starts there. If more than (periods - 1) / 2 periods
/// have one, this is a property of the signal, and none is reported.
/// @param samples  of `periods` periods (more rows are ignored), one column per channel
/// @returns at most one entry per period, ascending
std::vector<Glitch> find_glitches(const Eigen::MatrixXd& samples, Eigen::Index channels,
                                  Eigen::Index period_samples, int periods);

}  // namespace stageid
