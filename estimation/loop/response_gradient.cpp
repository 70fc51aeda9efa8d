#include "estimation/loop/response_gradient.hpp"

#include <numbers>

#include "acquisition/files/fail.hpp"
#include "estimation/products/equation_method.hpp"

namespace stageid {

ResponseGradient::ResponseGradient(const AdditiveModel& model, Eigen::Index parameters,
                                   const Eigen::VectorXd& frequency_hz) {
  if (!(model.sample_rate_hz > 0.0))
    fail_request("model: a loop needs a sample rate, but the model has none; set sample_rate_hz");
  const Eigen::Index channels = model.n_outputs() * model.n_inputs();
  problem_.lines = {2.0 * std::numbers::pi * frequency_hz, 1.0 / model.sample_rate_hz,
                    HoldModel::exact};
  problem_.n_outputs = model.n_outputs();
  problem_.n_inputs = model.n_inputs();
  problem_.G = Eigen::MatrixXcd(channels, frequency_hz.size());
  for (const Submodel& s : model.submodels) {
    problem_.shapes.push_back(shape_of(s));
    beta_.a.emplace_back(s.coefficients());
  }
  beta_.input_delay_s = model.input_delays_s();
  beta_.output_delay_s = model.output_delays_s();
  beta_.B.resize(channels, problem_.functions());
  Eigen::Index f = 0;
  for (const Submodel& s : model.submodels)
    for (const Eigen::MatrixXd& B : s.numerator) beta_.B.col(f++) = B.reshaped();
  const Eigen::Index without_delays = problem_.parameters();
  const auto fits = [&](DelayModel delay) {
    problem_.delay = delay;
    return problem_.parameters() == parameters;
  };
  if (!fits(DelayModel::fixed) && !fits(DelayModel::estimate) && !fits(DelayModel::per_channel))
    fail_request("covariance: {} parameters; the model has {} besides its delays", parameters,
                 without_delays);
  groups_ = evaluate_groups(problem_, beta_, true);
}

Eigen::MatrixXcd ResponseGradient::of(Eigen::Index k, const Eigen::MatrixXcd& weights) const {
  const Eigen::Index globals = problem_.globals();
  Eigen::MatrixXcd out = Eigen::MatrixXcd::Zero(parameters(), weights.cols());
  for (const BasisGroup& group : groups_)
    for (const Eigen::Index c : group.channels) {
      const SplitMatrix J = global_columns(problem_, beta_, group, c, {k, 1});
      for (Eigen::Index p = 0; p < globals; ++p) out.row(p) += J(0, p) * weights.row(c);
      for (Eigen::Index f = 0; f < problem_.functions(); ++f)
        out.row(globals + c + problem_.channels() * f) = group.F(k, f) * weights.row(c);
    }
  return out;
}

}  // namespace stageid
