#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// A period of a record that holds a glitch.
struct Glitch {
  int period = 0;
  Eigen::Index channel = 0;
  double ratio = 0.0;  ///< of the sample to what its neighbours scatter
};

/// Finds glitches in a record whose transient is not over, where no period is like the next.
///
/// The difference of a sample to the one a period later, d[n] = x[n + N] - x[n], holds no excitation, and what is
/// left of the transient in it is smooth: its second difference in time is noise, and a glitch in period p
/// stands out of it in d of p - 1 and of p. It counts from sqrt(N) times the scatter of its 128 neighbours on, and
/// from 8 times (their median, as of normal noise: one in 1e15 samples by chance): what is less adds less than three
/// times a period's noise and costs the mean less than a period. Which of the two periods is wrong is told by
/// the next one, so three are needed, and in the first period the first 128 samples are not looked at, where the
/// excitation starts. If more than (periods - 1) / 2 periods have one, that is how the signal is: none is told.
/// @param samples  of `periods` periods (more rows are ignored), a channel a column
/// @returns one entry a period at most, ascending
std::vector<Glitch> find_glitches(const Eigen::MatrixXd& samples, Eigen::Index channels,
                                  Eigen::Index period_samples, int periods);

}  // namespace stageid
