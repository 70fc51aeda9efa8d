#pragma once

#include <Eigen/Core>

#include "excitation/multisine/frequency_grid.hpp"

namespace stageid {

/// Changes the phases of a multisine so that its peak falls, at the given amplitudes.
///
/// Each iteration clips the period, sampled four times as densely as the grid's own so that the
/// peaks between the samples count, at a fraction of its peak, takes the phases of what is left,
/// and restores the amplitudes. Returned is the best of all iterates, `phase_rad` among them.
/// Source of the scheme: E. Van der Ouderaa, J. Schoukens, J. Renneboog, Peak factor minimization
/// using a time-frequency domain swapping algorithm, IEEE Trans. Instrum. Meas. 37 (1988).
/// @param amplitude, phase_rad  size of the grid
/// @returns the new phases in [0, 2 pi), size of the grid
Eigen::VectorXd reduce_crest(const FrequencyGrid& grid,
                             const Eigen::Ref<const Eigen::VectorXd>& amplitude,
                             const Eigen::Ref<const Eigen::VectorXd>& phase_rad, int iterations);

}  // namespace stageid
