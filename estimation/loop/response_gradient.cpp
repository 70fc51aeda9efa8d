#include "estimation/loop/response_gradient.hpp"

#include <numbers>
#include <stdexcept>
#include "acquisition/files/fail.hpp"

namespace stageid {

ResponseGradient::ResponseGradient(const AdditiveModel& model, Eigen::Index parameters,
                                   const Eigen::VectorXd& frequency_hz)
    : model_(model), parameters_(parameters) {
  if (!(model.sample_rate_hz > 0.0))
    throw std::invalid_argument(
        "model: a loop needs a sample rate, but the model has none; set sample_rate_hz");
  const Eigen::Index channels = model.n_outputs() * model.n_inputs();
  Eigen::Index numerators = 0;
  for (const Submodel& s : model.submodels) {
    first_delay_ += s.order();
    numerators += std::ssize(s.numerator) * channels;
  }
  delays_ = parameters - first_delay_ - numerators;
  const Eigen::Index per_channel = model.n_inputs() + model.n_outputs() - 1;
  if (delays_ != 0 && delays_ != 1 && delays_ != per_channel)
    fail_request("covariance: {} parameters; the model has {} besides its delays", parameters,
                 first_delay_ + numerators);
  const ModelLines lines{2.0 * std::numbers::pi * frequency_hz, 1.0 / model.sample_rate_hz,
                         HoldModel::exact};
  for (const auto& [delay_s, members] :
       channels_by_delay(model.input_delays_s(), model.output_delays_s())) {
    const HoldEquivalent through(lines, delay_s);
    Group group{members, std::vector<SubmodelBasis>(model.submodels.size())};
    for (std::size_t i = 0; i < model.submodels.size(); ++i)
      evaluate_basis(through, shape_of(model.submodels[i]), model.submodels[i].coefficients(),
                     {true, delays_ > 0}, group.bases[i]);
    groups_.push_back(std::move(group));
  }
}

/// One delay of all channels, or those of all inputs and of all outputs but the last.
void ResponseGradient::add_delay(Eigen::Index channel, const Eigen::RowVectorXcd& by_delay,
                                 Eigen::MatrixXcd& out) const {
  const Eigen::Index n_y = model_.n_outputs();
  if (delays_ == 1) {
    out.row(first_delay_) += by_delay;
    return;
  }
  out.row(first_delay_ + channel / n_y) += by_delay;
  const Eigen::Index output = channel % n_y;
  if (output + 1 < n_y) out.row(first_delay_ + model_.n_inputs() + output) += by_delay;
}

void ResponseGradient::add_globals(const Group& group, std::size_t submodel, Eigen::Index first,
                                   Eigen::Index k, const Eigen::MatrixXcd& weights,
                                   Eigen::MatrixXcd& out) const {
  const Submodel& s = model_.submodels[submodel];
  const SubmodelBasis& basis = group.bases[submodel];
  for (std::size_t m = 0; m < s.numerator.size(); ++m) {
    const auto function = static_cast<Eigen::Index>(m);
    const double* B = s.numerator[m].data();
    for (const Eigen::Index c : group.channels) {
      const Eigen::RowVectorXcd weighted = weights.row(c) * B[c];
      for (int q = 0; q < s.order(); ++q)
        out.row(first + q) += weighted * basis.gradient(k, function * s.order() + q);
      if (delays_ > 0) add_delay(c, weighted * basis.delay(k, function), out);
    }
  }
}

Eigen::MatrixXcd ResponseGradient::of(Eigen::Index k, const Eigen::MatrixXcd& weights) const {
  const Eigen::Index channels = model_.n_outputs() * model_.n_inputs();
  Eigen::MatrixXcd out = Eigen::MatrixXcd::Zero(parameters_, weights.cols());
  for (const Group& group : groups_) {
    Eigen::Index global = 0;
    Eigen::Index numerator = first_delay_ + delays_;
    for (std::size_t i = 0; i < model_.submodels.size(); ++i) {
      const Submodel& s = model_.submodels[i];
      add_globals(group, i, global, k, weights, out);
      global += s.order();
      for (Eigen::Index m = 0; m < std::ssize(s.numerator); ++m, numerator += channels)
        for (const Eigen::Index c : group.channels)
          out.row(numerator + c) += weights.row(c) * group.bases[i].value(k, m);
    }
  }
  return out;
}

}  // namespace stageid
