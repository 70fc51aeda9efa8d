#pragma once

#include <Eigen/Core>
#include <complex>
#include <cstdint>
#include <numbers>

#include "excitation/multisine/frequency_grid.hpp"

/// Lines of a multisine before synthesis; arguments are not checked.
namespace stageid {

/// Amplitudes, size of the grid, of a multisine with rms 1 (mean square sum A_k^2 / 2). They are
/// proportional to `shape`, or flat if it is empty.
Eigen::VectorXd unit_rms_amplitude(const FrequencyGrid& grid, const Eigen::VectorXd& shape);

/// One phase per line, independent and uniform on [0, 2 pi), then changed in `crest_iterations`
/// that lower the peak. Size of the grid.
Eigen::VectorXd multisine_phase_rad(const FrequencyGrid& grid, const Eigen::VectorXd& amplitude,
                                    std::uint64_t seed, int crest_iterations);

/// factor * A_k / 2 * exp(j phi_k): the coefficients of exp(+j 2 pi l_k n / N).
Eigen::VectorXcd line_coefficients(std::complex<double> factor, const Eigen::VectorXd& amplitude,
                                   const Eigen::VectorXd& phase_rad);

/// The same for several axes: factor, amplitudes and phases of each in a row; zeros where the factor is zero.
Eigen::MatrixXcd axis_coefficients(const Eigen::VectorXcd& factors,
                                   const Eigen::MatrixXd& amplitude,
                                   const Eigen::MatrixXd& phase_rad);

/// The phase of a complex number in [0, 2 pi).
inline double positive_phase_rad(const std::complex<double>& value) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double phase = std::arg(value);
  const double positive = phase < 0.0 ? phase + kTurn : phase;
  return positive < kTurn ? positive : 0.0;  // a tiny negative phase is rounded up to a full turn
}

}  // namespace stageid
