#include "tests/estimation/loop_cases.hpp"

#include <numbers>

#include "excitation/decompositions/decompositions.hpp"

namespace stageid::test {

LoopController tracked_controller() {
  const AdditiveModel model = model_of({});
  const Eigen::MatrixXd B = model.submodels[0].numerator[0];
  const double omega = 2.0 * std::numbers::pi * 0.5;
  const double kd = omega * kTrackedRateHz;
  LoopController out{{"one", "two"}, pseudo_inverse(B), {}};
  out.system.A = Eigen::MatrixXd::Zero(2, 2);
  out.system.B = Eigen::MatrixXd::Identity(2, 2);
  out.system.C = -kd * Eigen::MatrixXd::Identity(2, 2);
  out.system.D = Eigen::MatrixXd{{kd + 0.5 * omega * omega, 0.0}, {0.0, 1.3 * kd}};
  out.system.C(1, 1) *= 1.29;  // and a slow proportional part
  return out;
}

Eigen::VectorXd parameters_of(const AdditiveModel& model, Eigen::Index delays) {
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

AdditiveModel with_parameters(AdditiveModel model, Eigen::Index delays, const Eigen::VectorXd& x) {
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

AdditiveModel FreeMass::model() const {
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

LoopController FreeMass::controller() const {
  LoopController out{{"z"}, Eigen::MatrixXd::Ones(1, 1), {}};
  out.system.A = Eigen::MatrixXd::Zero(1, 1);
  out.system.B = Eigen::MatrixXd::Ones(1, 1);
  out.system.C = Eigen::MatrixXd::Constant(1, 1, -kd / period_s);
  out.system.D = Eigen::MatrixXd::Constant(1, 1, kp + kd / period_s);
  return out;
}

Eigen::VectorXcd FreeMass::poles(double gain) const {
  const double c = gain * period_s * period_s / (2.0 * mass_kg);
  const double p = kp + kd / period_s;
  const double q = kd / period_s;
  Eigen::Matrix3d companion = Eigen::Matrix3d::Zero();
  companion.diagonal(-1).setOnes();
  companion.row(0) << 2.0 - c * p, -1.0 - c * (p - q), c * q;
  return eigenvalues(Eigen::MatrixXd(companion));
}

}  // namespace stageid::test
