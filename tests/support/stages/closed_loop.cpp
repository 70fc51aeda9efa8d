#include "tests/support/stages/closed_loop.hpp"

#include "excitation/decompositions/decompositions.hpp"

namespace stageid::test {
namespace {

/// R of one realization: for each experiment, n_u x lines; amplitude 1 a line, zippered lines as much
/// larger as they are fewer.
std::vector<Eigen::MatrixXcd> excitation_spectra(const LoopExperiment& x, Eigen::Index n_u,
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
LogSamples simulate_run(const ClosedLoop& loop, const LoopExperiment& x, const Eigen::MatrixXcd& R,
                        ComplexNoise& random, RealDft& dft, double noise_scale) {
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
      U.col(k) = solve(loop_gain, R.col(k) - C * v);
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

}  // namespace

std::vector<int> line_range(int first, int last, int step) {
  std::vector<int> lines;
  for (int l = first; l <= last; l += step) lines.push_back(l);
  return lines;
}

Eigen::VectorXcd ComplexNoise::gaussian(Eigen::Index n) {
  Eigen::VectorXcd w(n);
  for (Eigen::Index i = 0; i < n; ++i) w[i] = gaussian();
  return w;
}

Eigen::MatrixXd synthesize(const Eigen::MatrixXcd& spectrum, const std::vector<int>& lines,
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

double omega_of(const LoopExperiment& experiment, Eigen::Index k) {
  return 2.0 * std::numbers::pi * experiment.lines[k] * experiment.sample_rate_hz /
         experiment.period_samples;
}

MemoryLog log_of_runs(const LoopExperiment& x, Eigen::Index n_y, Eigen::Index n_u,
                      const SimulateRun& run) {
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

MemoryLog simulate_log(const ClosedLoop& loop, const LoopExperiment& x) {
  const Eigen::MatrixXcd G = loop.plant(1.0);
  return log_of_runs(x, G.rows(), G.cols(),
                     [&](std::size_t e, const Eigen::MatrixXcd& R, const Eigen::MatrixXd&,
                         ComplexNoise& random, RealDft& dft) {
                       return simulate_run(loop, x, R, random, dft,
                                           x.noise_scale.empty() ? 1.0 : x.noise_scale[e]);
                     });
}

ClosedLoop small_stage() {
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

ClosedLoop open_loop() {
  return {small_stage().plant, [](double) { return Eigen::MatrixXcd::Zero(3, 2); }};
}

}  // namespace stageid::test
