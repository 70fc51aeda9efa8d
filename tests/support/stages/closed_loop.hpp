#pragma once

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "excitation/multisine/dft.hpp"
#include "tests/support/logs/memory_log.hpp"

/// Closed-loop records solved line by line from u = r - C y, y = G u + v, so that there is no discretization error.
namespace stageid::test {

using Transfer = std::function<Eigen::MatrixXcd(double omega_rad_s)>;

struct ClosedLoop {
  Transfer plant;       ///< n_y x n_u
  Transfer controller;  ///< n_u x n_y
};

enum class AxisScheme : std::uint8_t { single_axis, orthogonal, random, zippered };

struct LoopExperiment {
  double sample_rate_hz = 1000.0;
  int period_samples = 250;
  std::vector<int> lines = {1, 3, 5, 7, 9, 13, 21, 35, 51, 75};
  int axes = 3;         ///< excited ones: the first actuators
  int experiments = 0;  ///< 0: as many as axes; ignored if zippered: one
  int realizations = 1;
  int periods = 2;
  int transient_periods = 1;  ///< these carry a ramp on top of the periodic part
  AxisScheme scheme = AxisScheme::single_axis;
  std::uint64_t seed = 1;
  Eigen::MatrixXcd
      noise_factor{};  ///< n_y x n_y, v = factor * w, E w w^H = I per line and period; empty: none
  std::vector<double> noise_scale{};  ///< of v, an experiment; empty: 1
};

/// First, first + step, ..., last.
std::vector<int> line_range(int first, int last, int step);

/// Circular complex Gaussian, E|w|^2 = 1, and phases; the same numbers with every standard library.
class ComplexNoise {
 public:
  explicit ComplexNoise(std::uint64_t seed) : engine_(seed) {}
  double uniform() { return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1p-53; }
  std::complex<double> phase() { return std::polar(1.0, 2.0 * std::numbers::pi * uniform()); }
  std::complex<double> gaussian() {
    const double magnitude = std::sqrt(-std::log(uniform()));
    return magnitude * phase();
  }
  Eigen::VectorXcd gaussian(Eigen::Index n);

 private:
  std::mt19937_64 engine_;
};

/// One period of channels x lines coefficients (DFT / samples): samples x channels.
Eigen::MatrixXd synthesize(const Eigen::MatrixXcd& spectrum, const std::vector<int>& lines,
                           RealDft& dft);

double omega_of(const LoopExperiment& experiment, Eigen::Index k);

/// A log with the samples of run(experiment, R, period of r, random, dft). Channels: excitation and actuators a1, a2, ...
/// [N], sensors z1, z2, ... [m].
using SimulateRun =
    std::function<LogSamples(std::size_t e, const Eigen::MatrixXcd& R,
                             const Eigen::MatrixXd& period, ComplexNoise& random, RealDft& dft)>;
MemoryLog log_of_runs(const LoopExperiment& x, Eigen::Index n_y, Eigen::Index n_u,
                      const SimulateRun& run);

MemoryLog simulate_log(const ClosedLoop& loop, const LoopExperiment& x);

/// A stage in small: rigid body, two modes with non-symmetric shapes, a delay; 2 sensors, 3
/// actuators. Its controller is not symmetric either, so that a transposed matrix is seen.
ClosedLoop small_stage();

/// The same without feedback.
ClosedLoop open_loop();

}  // namespace stageid::test
