#include "tests/support/stages/sampled_loop.hpp"

#include <cmath>
#include <complex>
#include <numbers>

#include "excitation/decompositions/decompositions.hpp"

namespace stageid::test {

Eigen::MatrixXcd SampledPlant::response(double omega_rad_s, double sample_rate_hz) const {
  const std::complex<double> z = std::polar(1.0, omega_rad_s / sample_rate_hz);
  const Eigen::MatrixXcd pencil =
      z * Eigen::MatrixXcd::Identity(A.rows(), A.cols()) - A.cast<std::complex<double>>();
  return C.cast<std::complex<double>>() * solve(pencil, B.cast<std::complex<double>>());
}

SampledPlant sampled_plant(int outputs, int inputs, const std::vector<PlantMode>& modes,
                           double sample_rate_hz, double gain) {
  const auto n = static_cast<Eigen::Index>(2 * modes.size());
  SampledPlant plant{Eigen::MatrixXd::Zero(n, n),
                     Eigen::MatrixXd::Zero(n, inputs),
                     Eigen::MatrixXd::Zero(outputs, n),
                     Eigen::MatrixXd(inputs, outputs),
                     {}};
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double angle = 2.0 * std::numbers::pi * modes[m].frequency_hz / sample_rate_hz;
    const double radius = std::exp(-1.0 / (modes[m].decay_s * sample_rate_hz));
    const auto i = static_cast<Eigen::Index>(2 * m);
    plant.A.block<2, 2>(i, i) << radius * std::cos(angle), radius * std::sin(angle),
        -radius * std::sin(angle), radius * std::cos(angle);
    for (int u = 0; u < inputs; ++u) {
      plant.B(i, u) = 0.1 * std::cos(1.3 * u + 0.7 * static_cast<double>(m) + 0.2);
    }
    for (int y = 0; y < outputs; ++y) {
      plant.C(y, i + 1) = 0.3 * std::cos(0.9 * y - 1.1 * static_cast<double>(m) + 0.4);
    }
  }
  for (int u = 0; u < inputs; ++u) {
    for (int y = 0; y < outputs; ++y) plant.K(u, y) = gain * std::cos(0.5 * u + 1.7 * y);
  }
  return plant;
}

double real_gaussian(ComplexNoise& random) {
  return std::numbers::sqrt2 * random.gaussian().real();
}

LogSamples simulate_sampled_run(const SampledPlant& plant, const LoopExperiment& x,
                                const Eigen::MatrixXd& period, double noise_std,
                                ComplexNoise& random, double cubic, double step) {
  const Eigen::Index total = (x.transient_periods + x.periods) * x.period_samples;
  LogSamples record;
  record.actuators.resize(total, plant.B.cols());
  record.sensors.resize(total, plant.C.rows());
  record.marked.setZero(total);
  Eigen::VectorXd state = Eigen::VectorXd::Zero(plant.A.rows());
  for (Eigen::Index n = 0; n < total; ++n) {
    Eigen::VectorXd y = plant.C * state;
    y.array() += cubic * y.array().cube();
    for (Eigen::Index i = 0; i < y.size(); ++i) y[i] += noise_std * real_gaussian(random);
    if (step > 0.0) y = step * (y / step).array().round();
    Eigen::VectorXd u = period.row(n % x.period_samples).transpose() - plant.K * y;
    record.sensors.row(n) = y;
    record.actuators.row(n) = u;
    if (plant.applied)
      for (Eigen::Index i = 0; i < u.size(); ++i) u[i] = plant.applied(i, u[i]);
    state = plant.A * state + plant.B * u;
  }
  return record;
}

MemoryLog simulate_sampled_log(const SampledPlant& plant, const LoopExperiment& x, double noise_std,
                               double cubic, double step) {
  return log_of_runs(x, plant.C.rows(), plant.B.cols(),
                     [&](std::size_t, const Eigen::MatrixXcd&, const Eigen::MatrixXd& period,
                         ComplexNoise& random, RealDft&) {
                       return simulate_sampled_run(plant, x, period, noise_std, random, cubic,
                                                   step);
                     });
}

MemoryLog record_realizations(const RealizationsSpec& spec) {
  LoopExperiment x{.sample_rate_hz = 2000.0, .period_samples = 1000, .axes = 2};
  x.lines = line_range(3, 301, 2);
  x.realizations = spec.realizations;
  x.periods = 4;
  x.transient_periods = 3;
  x.seed = spec.seed;
  ComplexNoise random(spec.seed + 100);
  const double first_hz = 60.0 + 60.0 * random.uniform();
  return simulate_sampled_log(
      sampled_plant(3, 2, {{first_hz * (1.0 + spec.change), 0.05}, {2.1 * first_hz, 0.04}},
                    x.sample_rate_hz, 0.02),
      x, spec.noise, spec.cubic, spec.step);
}

}  // namespace stageid::test
