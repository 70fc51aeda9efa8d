#pragma once

#include <Eigen/Core>

#include "excitation/multisine/frequency_grid.hpp"

namespace stageid {

/// Changes the phases of a multisine to lower its peak. The amplitudes remain as given.
///
/// Each iteration clips the period at a fraction of its peak, takes the phases of the clipped signal, and
/// restores the amplitudes. The period is sampled four times as densely as the grid, so that peaks between
/// the samples count. The result is the best iterate, `phase_rad` included.
/// Source: E. Van der Ouderaa, J. Schoukens, J. Renneboog, Peak factor minimization
/// using a time-frequency domain swapping algorithm, IEEE Trans. Instrum. Meas. 37 (1988).
/// @param amplitude, phase_rad  size of the grid
/// @returns the new phases in [0, 2 pi), size of the grid
Eigen::VectorXd reduce_crest(const FrequencyGrid& grid,
                             const Eigen::Ref<const Eigen::VectorXd>& amplitude,
                             const Eigen::Ref<const Eigen::VectorXd>& phase_rad, int iterations);

}  // namespace stageid
