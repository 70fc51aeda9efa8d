#include "estimation/model/additive_model.hpp"

#include <cmath>
#include <numbers>

#include "acquisition/files/fail.hpp"
#include "estimation/model/basis.hpp"

namespace stageid {

double Submodel::natural_frequency_hz() const {
  return 1.0 / (2.0 * std::numbers::pi * std::sqrt(denominator[2]));
}

double Submodel::damping_ratio() const {
  return denominator[1] / (2.0 * std::sqrt(denominator[2]));
}

Eigen::VectorXd AdditiveModel::input_delays_s() const {
  return input_delay_s.size() > 0 ? input_delay_s : Eigen::VectorXd::Zero(n_inputs());
}

Eigen::VectorXd AdditiveModel::output_delays_s() const {
  return output_delay_s.size() > 0 ? output_delay_s : Eigen::VectorXd::Zero(n_outputs());
}

double AdditiveModel::mean_delay_s() const {
  double delay_s = 0.0;
  if (input_delay_s.size() > 0) delay_s += input_delay_s.mean();
  if (output_delay_s.size() > 0) delay_s += output_delay_s.mean();
  return delay_s;
}

Eigen::MatrixXcd response(const AdditiveModel& model,
                          const Eigen::Ref<const Eigen::VectorXd>& frequency_hz, HoldModel hold) {
  return response(model, frequency_hz, hold, 0, model.n_outputs() * model.n_inputs());
}

Eigen::MatrixXcd response(const AdditiveModel& model,
                          const Eigen::Ref<const Eigen::VectorXd>& frequency_hz, HoldModel hold,
                          Eigen::Index first, Eigen::Index count) {
  if (hold != HoldModel::none && !(model.sample_rate_hz > 0.0))
    fail_request("model: a hold needs a sample rate, but the model has none; use hold none");
  if (hold == HoldModel::exact && frequency_hz.size() > 0 &&
      frequency_hz.maxCoeff() > 0.5 * model.sample_rate_hz * (1.0 + 1e-9))
    fail_request("model: a frequency is above half the sample rate; omit it or use hold none");
  const ModelLines lines{2.0 * std::numbers::pi * frequency_hz,
                         model.sample_rate_hz > 0.0 ? 1.0 / model.sample_rate_hz : 0.0, hold};
  Eigen::MatrixXcd out = Eigen::MatrixXcd::Zero(count, frequency_hz.size());
  SubmodelBasis basis;
  for (const auto& [delay, members] : channels_by_delay(model.input_delay_s, model.output_delay_s,
                                                        model.n_outputs(), first, count)) {
    const HoldEquivalent through(lines, delay);
    for (const Submodel& submodel : model.submodels) {
      const SubmodelShape shape = shape_of(submodel);
      evaluate_basis(through, shape, submodel.coefficients(), {}, basis);
      for (Eigen::Index k = 0; k < out.cols(); ++k)
        for (int m = 0; m <= shape.numerator_degree; ++m) {
          const double* B = submodel.numerator[m].data();
          for (const Eigen::Index c : members) out(c - first, k) += B[c] * basis.value(k, m);
        }
    }
  }
  return out;
}

}  // namespace stageid
