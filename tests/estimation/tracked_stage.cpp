#include "tests/estimation/tracked_stage.hpp"

#include <cmath>
#include <numbers>

namespace stageid::test {

std::array<Eigen::MatrixXd, 2> mode_numerator(std::size_t i) {
  const std::array<Eigen::Vector2d, 4> phi = {{{1.0, 0.4}, {-0.7, 0.9}, {0.8, 0.6}, {0.5, -1.0}}};
  const std::array<Eigen::Vector3d, 4> psi = {
      {{0.9, -0.5, 0.4}, {0.6, 0.8, -0.6}, {-0.4, 1.0, 0.7}, {0.8, 0.3, -0.9}}};
  const Eigen::MatrixXd N = phi[i] * psi[i].transpose();
  return {N, i == 3 ? Eigen::MatrixXd(2e-5 * phi[0] * psi[2].transpose())
                    : Eigen::MatrixXd::Zero(2, 3)};
}

AdditiveModel model_of(const StageProperties& stage) {
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

PeriodSpectra LoopSpectra::next(double disturbance) {
  const Eigen::Index N = U0_.cols();
  Eigen::MatrixXcd v = circular_matrix(random_, 2, N);
  v.row(1) += 0.5 * v.row(0);
  v += disturbance * circular_matrix(random_, 2, N);
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

Eigen::MatrixXcd LoopSpectra::free_response(std::size_t mode, double a, double b) {
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

void LoopSpectra::excite_all_but(std::size_t mode) {
  excite();
  const Eigen::Vector3d psi = mode_numerator(mode)[0].row(0).normalized();
  U0_ -= psi * (psi.transpose() * U0_).eval();
}

void LoopSpectra::become(const StageProperties& stage) {
  P_ = reference_response(model_of(stage), tracked_lines_hz(), HoldModel::exact);
}

}  // namespace stageid::test
