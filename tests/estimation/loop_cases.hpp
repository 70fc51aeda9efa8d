#pragma once

#include <Eigen/Core>
#include <complex>
#include <numbers>

#include "estimation/loop/loop_transfer.hpp"
#include "tests/estimation/tracked_stage.hpp"

// Loops whose transfer can be written by hand, and the parameters of a model in the order of FitCovariance.
namespace stageid::test {

/// A free mass behind a hold and a PD controller with backward difference:
///   P(z) = T^2 / (2 m) (z + 1) / (z - 1)^2,   K(z) = kp + kd (z - 1) / (T z).
struct FreeMass {
  double mass_kg = 2.0;
  double period_s = 1e-3;
  double kp = 2e4;
  double kd = 300.0;

  AdditiveModel model() const {
    AdditiveModel out;
    out.inputs = {{"a"}, {"N"}};
    out.outputs = {{"y"}, {"m"}};
    out.sample_rate_hz = 1.0 / period_s;
    out.hold = HoldModel::exact;
    Submodel body;
    body.integrators = 2;
    body.numerator = {Eigen::MatrixXd::Constant(1, 1, 1.0 / mass_kg)};
    out.submodels = {body};
    return out;
  }
  LoopController controller() const {
    LoopController out{{"z"}, Eigen::MatrixXd::Ones(1, 1), {}};
    out.system.A = Eigen::MatrixXd::Zero(1, 1);
    out.system.B = Eigen::MatrixXd::Ones(1, 1);
    out.system.C = Eigen::MatrixXd::Constant(1, 1, -kd / period_s);
    out.system.D = Eigen::MatrixXd::Constant(1, 1, kp + kd / period_s);
    return out;
  }
  std::complex<double> loop(std::complex<double> z) const {
    return period_s * period_s / (2.0 * mass_kg) * (z + 1.0) / ((z - 1.0) * (z - 1.0)) *
           (kp + kd * (z - 1.0) / (period_s * z));
  }
  std::complex<double> loop_at(double frequency_hz) const {
    return loop(std::polar(1.0, 2.0 * std::numbers::pi * frequency_hz * period_s));
  }
  /// The closed-loop poles: roots of z (z - 1)^2 + gain T^2 / (2 m) (z + 1) ((kp + kd / T) z - kd / T).
  Eigen::VectorXcd poles(double gain) const {
    const double c = gain * period_s * period_s / (2.0 * mass_kg);
    const double p = kp + kd / period_s;
    const double q = kd / period_s;
    Eigen::Matrix3d companion = Eigen::Matrix3d::Zero();
    companion.diagonal(-1).setOnes();
    companion.row(0) << 2.0 - c * p, -1.0 - c * (p - q), c * q;
    return companion.eigenvalues();
  }
};

/// The stage of tracked_stage.hpp, decoupled by its rigid body: two loops with PD controllers.
inline LoopController tracked_controller() {
  const AdditiveModel model = model_of({});
  const Eigen::MatrixXd B = model.submodels[0].numerator[0];
  const double omega = 2.0 * std::numbers::pi * 0.5;
  const double kd = omega * kTrackedRateHz;
  LoopController out{{"one", "two"}, B.transpose() * (B * B.transpose()).inverse(), {}};
  out.system.A = Eigen::MatrixXd::Zero(2, 2);
  out.system.B = Eigen::MatrixXd::Identity(2, 2);
  out.system.C = -kd * Eigen::MatrixXd::Identity(2, 2);
  out.system.D = Eigen::MatrixXd{{kd + 0.5 * omega * omega, 0.0}, {0.0, 1.3 * kd}};
  out.system.C(1, 1) *= 1.29;  // and a slow proportional part
  return out;
}

/// Denominators, delays (0, 1: all outputs, or n_u + n_y - 1), numerators.
inline Eigen::VectorXd parameters_of(const AdditiveModel& model, Eigen::Index delays) {
  std::vector<double> out;
  for (const Submodel& s : model.submodels)
    out.insert(out.end(), s.denominator.begin() + 1, s.denominator.end());
  const Eigen::VectorXd inputs = model.input_delays_s();
  const Eigen::VectorXd outputs = model.output_delays_s();
  for (Eigen::Index d = 0; d < delays; ++d)
    out.push_back(delays == 1         ? outputs[0]
                  : d < inputs.size() ? inputs[d]
                                      : outputs[d - inputs.size()]);
  for (const Submodel& s : model.submodels)
    for (const Eigen::MatrixXd& B : s.numerator)
      out.insert(out.end(), B.data(), B.data() + B.size());
  return Eigen::Map<const Eigen::VectorXd>(out.data(), std::ssize(out));
}

inline AdditiveModel with_parameters(AdditiveModel model, Eigen::Index delays,
                                     const Eigen::VectorXd& x) {
  Eigen::Index p = 0;
  for (Submodel& s : model.submodels)
    for (std::size_t q = 1; q < s.denominator.size(); ++q) s.denominator[q] = x[p++];
  Eigen::VectorXd inputs = model.input_delays_s();
  Eigen::VectorXd outputs = model.output_delays_s();
  for (Eigen::Index d = 0; d < delays; ++d, ++p) {
    if (delays == 1)
      outputs.setConstant(x[p]);
    else if (d < inputs.size())
      inputs[d] = x[p];
    else
      outputs[d - inputs.size()] = x[p];
  }
  model.input_delay_s = inputs;
  model.output_delay_s = outputs;
  for (Submodel& s : model.submodels)
    for (Eigen::MatrixXd& B : s.numerator)
      for (double& entry : B.reshaped()) entry = x[p++];
  return model;
}

}  // namespace stageid::test
