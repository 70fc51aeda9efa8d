#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>

#include "estimation/tracking/model_tracker.hpp"
#include "tests/support/models/model_reference.hpp"
#include "tests/support/process/random_numbers.hpp"

// A stage with two sensors and three actuators that is tracked: its properties, model and spectra.
namespace stageid::test {

inline constexpr double kTrackedRateHz = 2000.0;

/// Properties of the stage, as a mechanical engineer would state them.
struct StageProperties {
  std::array<double, 4> frequency_hz = {71.0, 122.0, 188.0, 253.0};
  std::array<double, 4> damping_ratio = {0.012, 0.01, 0.015, 0.02};
  Eigen::VectorXd sensor_gain = Eigen::VectorXd::Ones(2);
  Eigen::VectorXd actuator_gain = Eigen::VectorXd::Ones(3);
  double delay_s = 3.1e-4;
};

/// The mass-normalized numerator of mode i: N_0, and N_1 of a mode with general viscous damping.
inline std::array<Eigen::MatrixXd, 2> mode_numerator(std::size_t i) {
  const std::array<Eigen::Vector2d, 4> phi = {{{1.0, 0.4}, {-0.7, 0.9}, {0.8, 0.6}, {0.5, -1.0}}};
  const std::array<Eigen::Vector3d, 4> psi = {
      {{0.9, -0.5, 0.4}, {0.6, 0.8, -0.6}, {-0.4, 1.0, 0.7}, {0.8, 0.3, -0.9}}};
  const Eigen::MatrixXd N = phi[i] * psi[i].transpose();
  return {N, i == 3 ? Eigen::MatrixXd(2e-5 * phi[0] * psi[2].transpose())
                    : Eigen::MatrixXd::Zero(2, 3)};
}

/// The model of a stage: rigid body, four modes and a direct term.
inline AdditiveModel model_of(const StageProperties& stage) {
  AdditiveModel model;
  model.inputs = {{"a1", "a2", "a3"}, {"N", "N", "N"}};
  model.outputs = {{"y1", "y2"}, {"m", "m"}};
  model.sample_rate_hz = kTrackedRateHz;
  model.hold = HoldModel::exact;
  model.output_delay_s = Eigen::VectorXd::Constant(2, stage.delay_s);
  const auto through_gains = [&](const Eigen::MatrixXd& B) -> Eigen::MatrixXd {
    return stage.sensor_gain.asDiagonal() * B * stage.actuator_gain.asDiagonal();
  };
  Submodel rigid;
  rigid.integrators = 2;
  rigid.numerator = {through_gains(Eigen::MatrixXd{{0.5, 0.3, -0.2}, {0.1, 0.6, 0.4}})};
  model.submodels.push_back(rigid);
  for (std::size_t i = 0; i < stage.frequency_hz.size(); ++i) {
    const double omega = 2.0 * std::numbers::pi * stage.frequency_hz[i];
    Submodel mode;
    mode.denominator = {1.0, 2.0 * stage.damping_ratio[i] / omega, 1.0 / (omega * omega)};
    for (const Eigen::MatrixXd& N : mode_numerator(i))
      if (!N.isZero(0.0)) mode.numerator.push_back(through_gains(N) / (omega * omega));
    model.submodels.push_back(mode);
  }
  Submodel direct;
  direct.numerator = {through_gains(Eigen::MatrixXd{{2e-8, -1e-8, 3e-8}, {1e-8, 2e-8, 0.0}})};
  model.submodels.push_back(direct);
  return model;
}

inline Eigen::VectorXd tracked_lines_hz() { return Eigen::VectorXd::LinSpaced(60, 20.0, 315.0); }

inline Eigen::MatrixXcd random_spectra(RandomNumbers& random, Eigen::Index channels,
                                       Eigen::Index lines) {
  Eigen::MatrixXcd out(channels, lines);
  for (std::complex<double>& value : out.reshaped()) value = random.circular();
  return out;
}

/// The stage in closed loop, period after period: Y = P U + v, U = U0 - K v.
class LoopSpectra {
 public:
  explicit LoopSpectra(std::uint64_t seed) : random_(seed) {
    excite();
    become({});
  }
  /// Another excitation.
  void excite() { U0_ = random_spectra(random_, 3, tracked_lines_hz().size()); }
  /// Another excitation, which does not move a mode.
  void excite_all_but(std::size_t mode) {
    excite();
    const Eigen::Vector3d psi = mode_numerator(mode)[0].row(0).normalized();
    U0_ -= psi * (psi.transpose() * U0_).eval();
  }
  void become(const StageProperties& stage) {
    P_ = reference_response(model_of(stage), tracked_lines_hz(), HoldModel::exact);
  }
  /// From now on, every period begins in another state of two modes: of the rms of the noise, times this.
  void move(double motion) { motion_ = motion; }
  void multiply_noise(Eigen::Index sensor, double factor) { noise_[sensor] *= factor; }

  /// @param disturbance rms of a force on the stage in this period, relative to the noise
  PeriodSpectra next(double disturbance = 0.0) {
    const Eigen::Index N = U0_.cols();
    Eigen::MatrixXcd v = random_spectra(random_, 2, N);
    v.row(1) += 0.5 * v.row(0);
    v += disturbance * random_spectra(random_, 2, N);
    v = noise_.asDiagonal() * v;
    if (motion_ > 0.0)
      for (const std::size_t mode : {0UL, 2UL})
        v += motion_ * 1e-5 * free_response(mode, random_.normal(), random_.normal());
    PeriodSpectra period;
    period.U = U0_ - controller() * v;
    period.Y = v;
    for (Eigen::Index k = 0; k < N; ++k)
      period.Y.col(k) += P_.col(k).reshaped(2, 3) * period.U.col(k);
    return period;
  }

  /// Spectra, n_y x N, of one period of y(t) = phi e^(-zeta omega t) (a cos + b sin)(omega_d t), sample by sample.
  static Eigen::MatrixXcd free_response(std::size_t mode, double a, double b) {
    const StageProperties stage;
    const double omega = 2.0 * std::numbers::pi * stage.frequency_hz[mode];
    const double zeta = stage.damping_ratio[mode];
    const double omega_d = omega * std::sqrt(1.0 - zeta * zeta);
    const Eigen::VectorXd lines_hz = tracked_lines_hz();
    const int samples = static_cast<int>(std::lround(kTrackedRateHz / (lines_hz[1] - lines_hz[0])));
    Eigen::VectorXcd spectrum = Eigen::VectorXcd::Zero(lines_hz.size());
    for (int n = 0; n < samples; ++n) {
      const double t = n / kTrackedRateHz;
      const double y = std::exp(-zeta * omega * t) *
                       (a * std::cos(omega_d * t) + b * std::sin(omega_d * t)) / samples;
      for (Eigen::Index k = 0; k < spectrum.size(); ++k)
        spectrum[k] += y * std::polar(1.0, -2.0 * std::numbers::pi * lines_hz[k] * t);
    }
    const Eigen::MatrixXd N = mode_numerator(mode)[0];
    return N.col(0).normalized() * spectrum.transpose();
  }

 private:
  /// The noise in U is a tenth of the excitation.
  static Eigen::MatrixXcd controller() {
    const std::complex<double> j(0.0, 1.0);
    return Eigen::MatrixXcd{{3e5 + 2e5 * j, -1e5}, {1e5 * j, 4e5}, {-2e5, 2e5 + 3e5 * j}};
  }

  RandomNumbers random_;
  double motion_ = 0.0;
  Eigen::VectorXd noise_ = Eigen::Vector2d(8e-7, 16e-7);
  Eigen::MatrixXcd U0_;
  Eigen::MatrixXcd P_;
};

}  // namespace stageid::test
