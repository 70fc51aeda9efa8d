#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "tests/support/logs/memory_log.hpp"
#include "tests/support/stages/closed_loop.hpp"

/// A loop simulated sample by sample from rest, so that its records hold a true transient:
///   x[n+1] = A x[n] + B u[n],  y[n] = C x[n] + v[n],  u[n] = r[n] - K y[n] (+ distortions of u).
/// The truth is exact: G(z) = C (z I - A)^-1 B.
namespace stageid::test {

struct SampledPlant {
  Eigen::MatrixXd A, B, C;
  Eigen::MatrixXd K;  ///< n_u x n_y
  /// What actuator i applies for a command; empty: the command.
  std::function<double(Eigen::Index i, double command)> applied{};

  Eigen::MatrixXcd response(double omega_rad_s, double sample_rate_hz) const;
};

struct PlantMode {
  double frequency_hz;
  double decay_s;  ///< time constant of the amplitude
};

/// Modes with shapes that depend on mode and channel and have no symmetry; unit gain at resonance
/// over decay. Weak feedback K = gain C B-like: stable for small gains.
SampledPlant sampled_plant(int outputs, int inputs, const std::vector<PlantMode>& modes,
                           double sample_rate_hz, double gain);

/// Gaussian, real, variance 1.
double real_gaussian(ComplexNoise& random);

/// Samples of one run from rest; `cubic`: y gains cubic * y^3 before the noise; `step`: of the converters of y.
LogSamples simulate_sampled_run(const SampledPlant& plant, const LoopExperiment& x,
                                const Eigen::MatrixXd& period, double noise_std,
                                ComplexNoise& random, double cubic = 0.0, double step = 0.0);

/// As simulate_log(), from rest. x.transient_periods are periods like all others, only declared.
MemoryLog simulate_sampled_log(const SampledPlant& plant, const LoopExperiment& x, double noise_std,
                               double cubic = 0.0, double step = 0.0);

/// A log of several realizations that a comparison can use: two axes, three sensors, two modes.
struct RealizationsSpec {
  int realizations = 3;
  std::uint64_t seed = 1;
  double noise = 1e-4;
  double cubic = 0.0;
  double change = 0.0;  ///< relative, of the first mode's frequency
  double step = 0.0;    ///< of the sensors' converters
};
MemoryLog record_realizations(const RealizationsSpec& spec);

}  // namespace stageid::test
