#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
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
inline std::vector<int> line_range(int first, int last, int step) {
  std::vector<int> lines;
  for (int l = first; l <= last; l += step) lines.push_back(l);
  return lines;
}

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
  Eigen::VectorXcd gaussian(Eigen::Index n) {
    Eigen::VectorXcd w(n);
    for (Eigen::Index i = 0; i < n; ++i) w[i] = gaussian();
    return w;
  }

 private:
  std::mt19937_64 engine_;
};

/// One period of channels x lines coefficients (DFT / samples): samples x channels.
inline Eigen::MatrixXd synthesize(const Eigen::MatrixXcd& spectrum, const std::vector<int>& lines,
                                  RealDft& dft) {
  Eigen::MatrixXd period(dft.length(), spectrum.rows());
  for (Eigen::Index c = 0; c < spectrum.rows(); ++c) {
    Eigen::VectorXcd half = Eigen::VectorXcd::Zero(dft.half_size());
    for (std::size_t k = 0; k < lines.size(); ++k) {
      half[lines[k]] = spectrum(c, static_cast<Eigen::Index>(k));
    }
    period.col(c) = dft.inverse(half);
  }
  return period;
}

inline double omega_of(const LoopExperiment& experiment, Eigen::Index k) {
  return 2.0 * std::numbers::pi * experiment.lines[k] * experiment.sample_rate_hz /
         experiment.period_samples;
}

/// R of one realization: for each experiment, n_u x lines; amplitude 1 a line, zippered lines as much
/// larger as they are fewer.
inline std::vector<Eigen::MatrixXcd> excitation_spectra(const LoopExperiment& x, Eigen::Index n_u,
                                                        ComplexNoise& random) {
  const int experiments = x.scheme == AxisScheme::zippered ? 1
                          : x.experiments > 0              ? x.experiments
                                                           : x.axes;
  const auto N = static_cast<Eigen::Index>(x.lines.size());
  std::vector<Eigen::MatrixXcd> R(experiments, Eigen::MatrixXcd::Zero(n_u, N));
  for (int axis = 0; axis < x.axes; ++axis) {
    for (Eigen::Index k = 0; k < N; ++k) {
      const std::complex<double> phase = random.phase();
      for (int e = 0; e < experiments; ++e) {
        std::complex<double>& r = R[e](axis, k);
        switch (x.scheme) {
          case AxisScheme::single_axis:
            if (e % x.axes == axis) r = e < x.axes ? phase : random.phase();
            break;
          case AxisScheme::orthogonal:
            r = phase * std::polar(1.0, 2.0 * std::numbers::pi * axis * e / experiments);
            break;
          case AxisScheme::random:
            r = random.phase();
            break;
          case AxisScheme::zippered:
            if (k % x.axes == axis) r = std::sqrt(static_cast<double>(x.axes)) * phase;
            break;
        }
      }
    }
  }
  return R;
}

/// Samples of one run; column k of R is the excitation on line k.
inline LogSamples simulate_run(const ClosedLoop& loop, const LoopExperiment& x,
                               const Eigen::MatrixXcd& R, ComplexNoise& random, RealDft& dft,
                               double noise_scale = 1.0) {
  const Eigen::Index n_u = R.rows();
  const Eigen::Index n_y = loop.plant(1.0).rows();
  const Eigen::Index n = x.period_samples;
  const int total = x.transient_periods + x.periods;
  LogSamples record;
  record.actuators.resize(total * n, n_u);
  record.sensors.resize(total * n, n_y);
  record.marked.setZero(total * n);
  for (int p = 0; p < total; ++p) {
    Eigen::MatrixXcd U(n_u, R.cols());
    Eigen::MatrixXcd Y(n_y, R.cols());
    for (Eigen::Index k = 0; k < R.cols(); ++k) {
      const double omega = omega_of(x, k);
      const Eigen::MatrixXcd G = loop.plant(omega);
      const Eigen::MatrixXcd C = loop.controller(omega);
      Eigen::VectorXcd v = Eigen::VectorXcd::Zero(n_y);
      if (x.noise_factor.size() != 0) v = noise_scale * x.noise_factor * random.gaussian(n_y);
      const Eigen::MatrixXcd loop_gain = Eigen::MatrixXcd::Identity(n_u, n_u) + C * G;
      U.col(k) = loop_gain.partialPivLu().solve(R.col(k) - C * v);
      Y.col(k) = G * U.col(k) + v;
    }
    record.actuators.middleRows(p * n, n) = synthesize(U, x.lines, dft);
    record.sensors.middleRows(p * n, n) = synthesize(Y, x.lines, dft);
    if (p >= x.transient_periods) continue;
    // A decaying transient, so that a test would detect its use.
    const Eigen::VectorXd decay = Eigen::VectorXd::LinSpaced(n, 1.0, 0.0);
    record.actuators.middleRows(p * n, n).colwise() += decay;
    record.sensors.middleRows(p * n, n).colwise() += 2.0 * decay;
  }
  return record;
}

/// A log with the samples of run(experiment, R, period of r, random, dft). Channels: excitation and actuators a1, a2, ... [N],
/// sensors z1, z2, ... [m].
template <typename Run>
MemoryLog log_of_runs(const LoopExperiment& x, Eigen::Index n_y, Eigen::Index n_u, Run run) {
  MemoryLog log;
  log.log_info.sample_rate_hz = x.sample_rate_hz;
  log.log_info.period_samples = x.period_samples;
  log.log_info.transient_periods = x.transient_periods;
  log.log_info.excitation = log.log_info.actuators = channels("a", n_u, "N");
  log.log_info.sensors = channels("z", n_y, "m");
  ComplexNoise random(x.seed);
  RealDft dft(x.period_samples);
  for (int m = 0; m < x.realizations; ++m) {
    const std::vector<Eigen::MatrixXcd> R = excitation_spectra(x, n_u, random);
    for (std::size_t e = 0; e < R.size(); ++e) {
      const Eigen::MatrixXd period = synthesize(R[e], x.lines, dft);
      log.append(m, static_cast<int>(e), period, run(e, R[e], period, random, dft));
    }
  }
  return log;
}

inline MemoryLog simulate_log(const ClosedLoop& loop, const LoopExperiment& x) {
  const Eigen::MatrixXcd G = loop.plant(1.0);
  return log_of_runs(x, G.rows(), G.cols(),
                     [&](std::size_t e, const Eigen::MatrixXcd& R, const Eigen::MatrixXd&,
                         ComplexNoise& random, RealDft& dft) {
                       return simulate_run(loop, x, R, random, dft,
                                           x.noise_scale.empty() ? 1.0 : x.noise_scale[e]);
                     });
}

/// A stage in small: rigid body, two modes with non-symmetric shapes, a delay; 2 sensors, 3
/// actuators. Its controller is not symmetric either, so that a transposed matrix is seen.
inline ClosedLoop small_stage() {
  ClosedLoop loop;
  loop.plant = [](double omega) {
    const std::complex<double> s(0.0, omega);
    Eigen::MatrixXcd rigid(2, 3);
    rigid << 1.0, 0.6, -0.2, 0.3, 1.1, 0.8;
    Eigen::VectorXcd phi1(2), phi2(2);
    Eigen::RowVectorXcd psi1(3), psi2(3);
    phi1 << 0.7, -0.4;
    phi2 << 0.2, 0.9;
    psi1 << 1.0, -0.5, 0.3;
    psi2 << -0.6, 0.1, 0.8;
    const double w1 = 2.0 * std::numbers::pi * 60.0;
    const double w2 = 2.0 * std::numbers::pi * 140.0;
    const Eigen::MatrixXcd sum = rigid / (s * s) + phi1 * psi1 / (s * s + 0.04 * w1 * s + w1 * w1) +
                                 phi2 * psi2 / (s * s + 0.02 * w2 * s + w2 * w2);
    return Eigen::MatrixXcd(1e4 * std::exp(-s * 4e-4) * sum);
  };
  loop.controller = [](double omega) {
    const std::complex<double> s(0.0, omega);
    Eigen::MatrixXcd gain(3, 2);
    gain << 0.8, -0.3, 0.1, 0.9, 0.4, 0.5;
    return Eigen::MatrixXcd(0.3 * (1.0 + s / 60.0) / (1.0 + s / 900.0) * gain);
  };
  return loop;
}

}  // namespace stageid::test
