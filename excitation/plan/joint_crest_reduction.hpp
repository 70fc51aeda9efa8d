#pragma once

#include <Eigen/Core>
#include <vector>

#include "excitation/multisine/bounded_signal.hpp"
#include "excitation/multisine/frequency_grid.hpp"

namespace stageid {

/// What reduce_joint_crest() works on. References outlive the call.
struct JointCrestProblem {
  const FrequencyGrid& grid;
  const Eigen::MatrixXcd& mixing;             ///< T, axes x experiments
  const std::vector<BoundedSignal>& signals;  ///< those with a finite peak limit count
  const Eigen::MatrixXd& amplitude;           ///< A, axes x lines
  double enough = 0.0;  ///< peak over limit below which nothing is to be gained any more
};

/// Changes the phases of all axes at once so that the largest peak over its limit, of all signals in
/// all experiments of one realization, falls at the given amplitudes: u and y, not only r.
///
/// Each iteration synthesizes every signal of every experiment densely, clips it at a level common to
/// all ratios, and takes what was cut off, d, back through the loop by least squares,
///   R_p <- R_p - step sum_se conj(H_sp T_pe) D_se / sum_se |H_sp T_pe|^2,   H = transfer / limit;
/// then every line gets its amplitude back. For orthogonal T the sum over e parts the axes. The step
/// grows with the number of signals that share the denominator and do not clip. The best iterate is
/// returned, the start among them.
/// Source of the scheme for one signal: E. Van der Ouderaa, J. Schoukens, J. Renneboog, Peak factor
/// minimization using a time-frequency domain swapping algorithm, IEEE Trans. Instrum. Meas. 37 (1988).
/// @param phase_rad  axes x lines, the start
/// @returns phases in [0, 2 pi), axes x lines
Eigen::MatrixXd reduce_joint_crest(const JointCrestProblem& problem,
                                   const Eigen::Ref<const Eigen::MatrixXd>& phase_rad,
                                   int iterations);

}  // namespace stageid
