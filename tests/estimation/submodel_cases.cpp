#include "tests/estimation/submodel_cases.hpp"

#include <cmath>

#include "tests/support/models/model_reference.hpp"

namespace stageid::test {

DenseProblem measured(const std::vector<Part>& parts, HoldModel hold, double delay_s) {
  RandomNumbers random(17);
  DenseProblem problem;
  problem.model = named_model(2, 2);
  problem.hold = hold;
  if (hold != HoldModel::none) problem.model.sample_rate_hz = 4000.0;
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(400, 5.0, 999.0);
  for (const Part& part : parts) {
    const Eigen::VectorXd a = denominator_of(part.poles);
    Submodel s =
        empty_submodel(problem.model, part.integrators, {a.begin(), a.end()}, part.degree + 1);
    double size = std::pow(kMiddleRad, part.integrators);
    for (Eigen::MatrixXd& B : s.numerator) {
      for (double& value : B.reshaped()) value = size * random.normal();
      size /= kMiddleRad;
    }
    problem.model.submodels.push_back(std::move(s));
  }
  problem.model.input_delay_s.setConstant(2, delay_s);
  problem.model.output_delay_s.setZero(2);
  problem.G = reference_response(problem.model, problem.frequency_hz, hold);
  return problem;
}

AdditiveModel start_of(const std::vector<Part>& parts, const DenseProblem& problem) {
  AdditiveModel start;
  double move = 1.02;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    Poles poles = parts[i].poles;
    for (std::complex<double>& pole : poles) {
      pole = {pole.real() * (pole.imag() == 0.0 ? move : 0.7), pole.imag() * move};
      if (pole.imag() <= 0.0) move = 1.0 / move;  // the second of a pair, or a real one
    }
    Submodel s = problem.model.submodels[i];
    const Eigen::VectorXd a = denominator_of(poles);
    s.denominator.assign(1, 1.0);
    s.denominator.insert(s.denominator.end(), a.begin(), a.end());
    for (Eigen::MatrixXd& B : s.numerator) B.setZero();
    s.role = SubmodelRole::given;
    start.submodels.push_back(std::move(s));
  }
  return start;
}

FrfEstimate noisy(const DenseProblem& problem, double part, std::uint64_t seed) {
  FrfEstimate frf = frf_of(problem);
  const double deviation = part * frf.response.cwiseAbs().mean();
  RandomNumbers random(seed);
  for (std::complex<double>& value : frf.response.reshaped())
    value += deviation * random.circular();
  frf.noise_variance =
      Eigen::MatrixXd::Constant(frf.response.rows(), frf.response.cols(), deviation * deviation);
  return frf;
}

FitResult fit_submodels(const FrfEstimate& frf, std::vector<SubmodelRequest> submodels,
                        const FitOptions& options, std::vector<ModeCandidate> modes) {
  RequestedStructure structure;
  structure.common.rigid_body = false;
  structure.submodels = std::move(submodels);
  return structured_fit(frf, structure, {.modes = std::move(modes), .keep_modes = true}, options);
}

}  // namespace stageid::test
