#include "excitation/multisine/multisine_lines.hpp"

#include <cmath>
#include <limits>

#include "excitation/multisine/line_spectrum.hpp"
#include "excitation/multisine/random_stream.hpp"

namespace stageid {
namespace {

constexpr int kOversampling = 4;

// The clipping level rises from the first to the last fraction of the peak. Low levels change the signal
// quickly and then stall; high levels refine it. On 4000 odd lines, 500 iterations with this rise reach a
// crest factor of 1.43; fixed fractions of 0.7, 0.8, 0.9 reach 1.64, 1.56, 1.56.
constexpr double kFirstFraction = 0.7;
constexpr double kLastFraction = 0.99;

/// Restores the amplitude of every line and keeps its phase; a line that vanished keeps its old value.
void restore_amplitudes(const Eigen::VectorXd& amplitude, const Eigen::VectorXcd& clipped,
                        Eigen::VectorXcd& coefficients) {
  for (Eigen::Index k = 0; k < amplitude.size(); ++k) {
    const double size = std::abs(clipped[k]);
    if (size > 0.0) coefficients[k] = clipped[k] * (amplitude[k] / 2.0 / size);
  }
}

/// Changes the phases of a multisine to lower its peak. The amplitudes remain as given.
///
/// Each iteration clips the period at a fraction of its peak, takes the phases of the clipped signal, and
/// restores the amplitudes. The period is sampled four times as densely as the grid, so that peaks between
/// the samples count. The result is the best iterate, `phase_rad` included.
/// Source: E. Van der Ouderaa, J. Schoukens, J. Renneboog, Peak factor minimization
/// using a time-frequency domain swapping algorithm, IEEE Trans. Instrum. Meas. 37 (1988).
/// @param amplitude, phase_rad  size of the grid
/// @returns the new phases in [0, 2 pi), size of the grid
Eigen::VectorXd reduce_crest(const FrequencyGrid& grid, const Eigen::VectorXd& amplitude,
                             const Eigen::VectorXd& phase_rad, int iterations) {
  LineSpectrum spectrum(grid, kOversampling);
  Eigen::VectorXcd coefficients = line_coefficients(1.0, amplitude, phase_rad);
  Eigen::VectorXcd best;
  double best_peak = std::numeric_limits<double>::infinity();
  bool start_is_best = true;
  for (int i = 0; i <= iterations; ++i) {
    const Eigen::VectorXd samples = spectrum.samples(coefficients);
    const double peak = samples.cwiseAbs().maxCoeff();
    if (peak < best_peak) {
      best_peak = peak;
      best = coefficients;
      start_is_best = i == 0;
    }
    if (i == iterations) break;
    const double fraction = kFirstFraction + (kLastFraction - kFirstFraction) * i / iterations;
    const double level = fraction * peak;
    const Eigen::VectorXcd clipped =
        spectrum.coefficients(samples.cwiseMax(-level).cwiseMin(level));
    restore_amplitudes(amplitude, clipped, coefficients);
  }
  if (start_is_best) return phase_rad;

  Eigen::VectorXd reduced(grid.size());
  for (Eigen::Index k = 0; k < grid.size(); ++k) {
    // A line without amplitude has no phase in `best`, and any phase will do.
    reduced[k] = amplitude[k] > 0.0 ? positive_phase_rad(best[k]) : phase_rad[k];
  }
  return reduced;
}

}  // namespace

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
