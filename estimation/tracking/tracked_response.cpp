#include "estimation/tracking/tracked_response.hpp"

#include <complex>
#include <numbers>
#include <utility>

#include "estimation/model/basis.hpp"

namespace stageid {

struct TrackedResponse::Changes {
  Eigen::VectorXd frequency;  // by submodel
  Eigen::VectorXd damping;
  Eigen::VectorXd sensor;  // factors
  Eigen::VectorXd actuator;
  double delay_s = 0.0;

  double& of(const TrackedParameter& parameter) {
    switch (parameter.kind) {
      case TrackedKind::frequency:
        return frequency[parameter.index];
      case TrackedKind::damping:
        return damping[parameter.index];
      case TrackedKind::sensor_gain:
        return sensor[parameter.index];
      case TrackedKind::actuator_gain:
        return actuator[parameter.index];
      case TrackedKind::delay:
        break;
    }
    return delay_s;
  }
};

TrackedResponse::TrackedResponse(const AdditiveModel& model,
                                 std::vector<TrackedParameter> parameters,
                                 const Eigen::VectorXd& frequency_hz)
    : model_(model),
      parameters_(std::move(parameters)),
      lines_{2.0 * std::numbers::pi * frequency_hz, 1.0 / model.sample_rate_hz,
             model.hold == HoldModel::none ? HoldModel::exact : model.hold} {}

TrackedResponse::Changes TrackedResponse::changes(const Eigen::VectorXd& x) const {
  const auto submodels = std::ssize(model_.submodels);
  Changes out{Eigen::VectorXd::Zero(submodels), Eigen::VectorXd::Zero(submodels),
              Eigen::VectorXd::Ones(model_.n_outputs()), Eigen::VectorXd::Ones(model_.n_inputs())};
  for (Eigen::Index p = 0; p < size(); ++p) out.of(parameters_[p]) += x[p];
  return out;
}

Submodel TrackedResponse::changed(std::size_t submodel, const Changes& change) const {
  const Submodel& s = model_.submodels[submodel];
  return s.is_mode() ? moved(s, change.frequency[submodel], change.damping[submodel]) : s;
}

Eigen::MatrixXcd TrackedResponse::response_of(AdditiveModel model, const Changes& change) const {
  for (Submodel& submodel : model.submodels)
    for (Eigen::MatrixXd& numerator : submodel.numerator)
      numerator = change.sensor.asDiagonal() * numerator * change.actuator.asDiagonal();
  model.output_delay_s = model.output_delays_s().array() + change.delay_s;
  return response(model, lines_.omega_rad_s / (2.0 * std::numbers::pi), lines_.hold);
}

Eigen::MatrixXcd TrackedResponse::at(const Eigen::VectorXd& x) const {
  const Changes change = changes(x);
  AdditiveModel model = model_;
  for (std::size_t i = 0; i < model.submodels.size(); ++i) model.submodels[i] = changed(i, change);
  return response_of(std::move(model), change);
}

Eigen::MatrixXcd TrackedResponse::at(const Eigen::VectorXd& x, Eigen::Index submodel) const {
  const Changes change = changes(x);
  AdditiveModel model = model_;
  model.submodels = {changed(static_cast<std::size_t>(submodel), change)};
  return response_of(std::move(model), change);
}

Eigen::MatrixXcd TrackedResponse::outputs(const Eigen::MatrixXcd& P, const Eigen::MatrixXcd& U) {
  const Eigen::Index n_y = P.rows() / U.rows();
  Eigen::MatrixXcd Y(n_y, U.cols());
  for (Eigen::Index k = 0; k < U.cols(); ++k)
    Y.col(k).noalias() = P.col(k).reshaped(n_y, U.rows()) * U.col(k);
  return Y;
}

Eigen::MatrixXcd TrackedResponse::derivatives(const Eigen::VectorXd& x,
                                              const Eigen::MatrixXcd& U) const {
  const Changes change = changes(x);
  const Eigen::Index n_y = model_.n_outputs();
  const Eigen::Index n_u = model_.n_inputs();
  const Eigen::Index N = lines();
  // Of every submodel, to its frequency and damping; of all together, to delay and gains.
  const auto submodels = std::ssize(model_.submodels);
  std::vector<Eigen::MatrixXcd> by_frequency(submodels, Eigen::MatrixXcd::Zero(n_y, N));
  std::vector<Eigen::MatrixXcd> by_damping = by_frequency;
  Eigen::MatrixXcd by_delay = Eigen::MatrixXcd::Zero(n_y, N);
  SubmodelBasis basis;
  for (const auto& [delay_s, members] :
       channels_by_delay(model_.input_delay_s, model_.output_delay_s, n_y, 0, n_y * n_u)) {
    const HoldEquivalent through(lines_, delay_s + change.delay_s);
    for (std::size_t i = 0; i < model_.submodels.size(); ++i) {
      const Submodel submodel = changed(i, change);
      const bool mode = submodel.is_mode();
      const SubmodelShape shape = shape_of(submodel);
      evaluate_basis(through, shape, submodel.coefficients(), {mode, true}, basis);
      for (int p = 0; p <= shape.numerator_degree; ++p) {
        Eigen::MatrixXd B = Eigen::MatrixXd::Zero(n_y, n_u);
        for (const Eigen::Index c : members)
          B.data()[c] =
              submodel.numerator[p].data()[c] * change.sensor[c % n_y] * change.actuator[c / n_y];
        const Eigen::MatrixXcd BU = B * U;
        for (Eigen::Index k = 0; k < N; ++k) {
          by_delay.col(k) += BU.col(k) * basis.delay(k, p);
          if (!mode) continue;
          const std::complex<double> d1 = basis.gradient(k, 2 * p);
          const std::complex<double> d2 = basis.gradient(k, 2 * p + 1);
          const double a1 = submodel.denominator[1];
          const double a2 = submodel.denominator[2];
          by_damping[i].col(k) += BU.col(k) * (d1 * (a1 / (1.0 + change.damping[i])));
          by_frequency[i].col(k) -=
              BU.col(k) *
              ((d1 * a1 + 2.0 * d2 * a2 + 2.0 * basis.value(k, p)) / (1.0 + change.frequency[i]));
        }
      }
    }
  }
  Eigen::VectorXd without_gains = x;
  for (Eigen::Index p = 0; p < size(); ++p) {
    const TrackedKind kind = parameters_[p].kind;
    if (kind == TrackedKind::sensor_gain || kind == TrackedKind::actuator_gain)
      without_gains[p] = 0.0;
  }
  const Eigen::MatrixXcd P = at(without_gains);
  Eigen::MatrixXcd out(n_y * N, size());
  for (Eigen::Index p = 0; p < size(); ++p) {
    const TrackedParameter& parameter = parameters_[p];
    auto column = out.col(p).reshaped(n_y, N);
    switch (parameter.kind) {
      case TrackedKind::frequency:
        column = by_frequency[parameter.index];
        break;
      case TrackedKind::damping:
        column = by_damping[parameter.index];
        break;
      case TrackedKind::delay:
        column = by_delay;
        break;
      case TrackedKind::sensor_gain:
        column.setZero();
        for (Eigen::Index k = 0; k < N; ++k)
          column(parameter.index, k) =
              (P.col(k).reshaped(n_y, n_u).row(parameter.index).transpose().array() *
               change.actuator.array() * U.col(k).array())
                  .sum();
        break;
      case TrackedKind::actuator_gain:
        for (Eigen::Index k = 0; k < N; ++k)
          column.col(k) = change.sensor.asDiagonal() *
                          (P.col(k).segment(parameter.index * n_y, n_y) * U(parameter.index, k));
        break;
    }
  }
  return out;
}

}  // namespace stageid
