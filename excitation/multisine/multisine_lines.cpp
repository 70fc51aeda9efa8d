#include "excitation/multisine/multisine_lines.hpp"

#include <cmath>

#include "excitation/multisine/crest_reduction.hpp"
#include "excitation/multisine/random_stream.hpp"

namespace stageid {

Eigen::VectorXd unit_rms_amplitude(const FrequencyGrid& grid, const Eigen::VectorXd& shape) {
  if (shape.size() == 0) {
    const double amplitude = std::sqrt(2.0 / static_cast<double>(grid.size()));
    return Eigen::VectorXd::Constant(grid.size(), amplitude);
  }
  // Divided by its peak first, so that shapes in any unit (1e-200 or 1e200) can be squared.
  const Eigen::VectorXd relative = shape / shape.maxCoeff();
  return relative * (std::numbers::sqrt2 / relative.norm());
}

Eigen::VectorXd multisine_phase_rad(const FrequencyGrid& grid, const Eigen::VectorXd& amplitude,
                                    std::uint64_t seed, int crest_iterations) {
  UniformStream random(seed);
  Eigen::VectorXd phase_rad(grid.size());
  for (double& phase : phase_rad) phase = 2.0 * std::numbers::pi * random.next();
  return crest_iterations > 0 ? reduce_crest(grid, amplitude, phase_rad, crest_iterations)
                              : phase_rad;
}

Eigen::VectorXcd line_coefficients(std::complex<double> factor, const Eigen::VectorXd& amplitude,
                                   const Eigen::VectorXd& phase_rad) {
  Eigen::VectorXcd coefficients(amplitude.size());
  for (Eigen::Index k = 0; k < amplitude.size(); ++k) {
    coefficients[k] = factor * std::polar(amplitude[k] / 2.0, phase_rad[k]);
  }
  return coefficients;
}

Eigen::MatrixXcd axis_coefficients(const Eigen::VectorXcd& factors,
                                   const Eigen::MatrixXd& amplitude,
                                   const Eigen::MatrixXd& phase_rad) {
  Eigen::MatrixXcd coefficients = Eigen::MatrixXcd::Zero(amplitude.rows(), amplitude.cols());
  for (Eigen::Index p = 0; p < factors.size(); ++p)
    if (factors[p] != 0.0)
      coefficients.row(p) =
          line_coefficients(factors[p], amplitude.row(p).transpose(), phase_rad.row(p).transpose())
              .transpose();
  return coefficients;
}

}  // namespace stageid
