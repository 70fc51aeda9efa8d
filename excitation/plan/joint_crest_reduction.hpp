#pragma once

#include <Eigen/Core>
#include <vector>

#include "excitation/multisine/bounded_signal.hpp"
#include "excitation/multisine/frequency_grid.hpp"

namespace stageid {

/// Input of reduce_joint_crest(). The references must outlive the call.
struct JointCrestProblem {
  const FrequencyGrid& grid;
  const Eigen::MatrixXcd& mixing;             ///< T, axes x experiments
  const std::vector<BoundedSignal>& signals;  ///< those without a finite peak limit are ignored
  const Eigen::MatrixXd& amplitude;           ///< A, axes x lines
  double enough = 0.0;                        ///< stop below this ratio of peak to limit
};

/// Changes the phases of all axes jointly at the given amplitudes. It lowers the largest ratio of peak to
/// limit over all signals (u and y, not only r) in all experiments of one realization.
///
/// Each iteration synthesizes every signal of every experiment densely and clips it at one level for all
/// ratios. The part that was cut off, d, is taken back through the loop by least squares,
///   R_p <- R_p - step sum_se conj(H_sp T_pe) D_se / sum_se |H_sp T_pe|^2,   H = transfer / limit,
/// and the amplitudes are restored. For orthogonal T the sum over e separates the axes. Both sums contain
/// only the signals that clip. The result is the best iterate, the start included.
/// Source for one signal: E. Van der Ouderaa, J. Schoukens, J. Renneboog, Peak factor
/// minimization using a time-frequency domain swapping algorithm, IEEE Trans. Instrum. Meas. 37 (1988).
/// @param phase_rad  axes x lines, the start
/// @returns phases in [0, 2 pi), axes x lines
Eigen::MatrixXd reduce_joint_crest(const JointCrestProblem& problem,
                                   const Eigen::Ref<const Eigen::MatrixXd>& phase_rad,
                                   int iterations);

}  // namespace stageid
