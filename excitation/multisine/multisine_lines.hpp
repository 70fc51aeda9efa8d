#pragma once

#include <Eigen/Core>
#include <complex>
#include <cstdint>

#include "excitation/multisine/frequency_grid.hpp"

/// Lines of a multisine before synthesis; arguments are not checked.
namespace stageid {

/// Amplitudes, size of the grid, of a multisine with rms 1 (mean square sum A_k^2 / 2). They are
/// proportional to `shape`, or flat if it is empty.
Eigen::VectorXd unit_rms_amplitude(const FrequencyGrid& grid, const Eigen::VectorXd& shape);

/// One phase per line, independent and uniform on [0, 2 pi), then changed by `crest_iterations` of
/// reduce_crest(). Size of the grid.
Eigen::VectorXd multisine_phase_rad(const FrequencyGrid& grid, const Eigen::VectorXd& amplitude,
                                    std::uint64_t seed, int crest_iterations);

/// factor * A_k / 2 * exp(j phi_k): the coefficients of exp(+j 2 pi l_k n / N).
Eigen::VectorXcd line_coefficients(std::complex<double> factor, const Eigen::VectorXd& amplitude,
                                   const Eigen::VectorXd& phase_rad);

}  // namespace stageid
