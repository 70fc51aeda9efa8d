#pragma once

#include "tests/support/model_fit_problem.hpp"
#include "tests/support/model_reference.hpp"
#include "tests/support/random_stage.hpp"

namespace stageid::test {

/// A 2 x 3 stage, rigid body and three modes (two of them 1.5 % apart), relative noise.
inline DenseProblem noisy_stage(HoldModel hold, double noise, std::uint64_t seed = 1) {
  RandomNumbers random(seed);
  DenseProblem problem;
  problem.model = named_model(2, 3);
  problem.hold = hold;
  if (hold != HoldModel::none) {
    problem.model.sample_rate_hz = 1e4;
    problem.model.input_delay_s.setConstant(1.37e-4);
  }
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(400, 20.0, 1800.0);
  problem.model.submodels = {empty_submodel(problem.model, 2, {}, 1),
                             empty_submodel(problem.model, 0, mode_coefficients(260.0, 0.02), 1),
                             empty_submodel(problem.model, 0, mode_coefficients(900.0, 0.012), 1),
                             empty_submodel(problem.model, 0, mode_coefficients(914.0, 0.010), 1)};
  for (Submodel& s : problem.model.submodels)
    for (double& value : s.numerator[0].reshaped())
      value = (s.is_mode() ? s.denominator[2] : 1.0) * random.normal();
  problem.G = reference_response(problem.model, problem.frequency_hz, problem.hold);
  for (std::complex<double>& value : problem.G.reshaped()) value *= 1.0 + noise * random.circular();
  problem.W = problem.G.cwiseAbs2().cwiseInverse();
  return problem;
}

/// The model as a start: poles moved by these factors, numerators zero.
inline AdditiveModel moved(const AdditiveModel& model, double frequency_factor,
                           double damping_factor) {
  AdditiveModel start;
  for (Submodel s : model.submodels) {
    for (Eigen::MatrixXd& B : s.numerator) B.setZero();
    if (s.is_mode()) {
      const std::vector<double> a = mode_coefficients(s.natural_frequency_hz() * frequency_factor,
                                                      s.damping_ratio() * damping_factor);
      s.denominator = {1.0, a[0], a[1]};
    }
    start.submodels.push_back(s);
  }
  return start;
}

}  // namespace stageid::test
