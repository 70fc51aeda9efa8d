#include "tests/support/models/model_fit_problem.hpp"

#include <cmath>
#include <complex>
#include <numbers>

#include "tests/support/logs/memory_log.hpp"

namespace stageid::test {

AdditiveModel named_model(int outputs, int inputs) {
  AdditiveModel model;
  model.outputs = channels("z", outputs, "m");
  model.inputs = channels("a", inputs, "N");
  model.input_delay_s = Eigen::VectorXd::Zero(inputs);
  model.output_delay_s = Eigen::VectorXd::Zero(outputs);
  return model;
}

Submodel empty_submodel(const AdditiveModel& model, int integrators, std::vector<double> a,
                        int matrices) {
  Submodel s;
  s.integrators = integrators;
  s.denominator.insert(s.denominator.end(), a.begin(), a.end());
  s.numerator.assign(matrices, Eigen::MatrixXd::Zero(model.n_outputs(), model.n_inputs()));
  return s;
}

Submodel empty_mode(const AdditiveModel& model, double frequency_hz, double damping_ratio,
                    int matrices) {
  return empty_submodel(model, 0, mode_coefficients(frequency_hz, damping_ratio), matrices);
}

void measure(DenseProblem& problem) {
  problem.G = reference_response(problem.model, problem.frequency_hz, problem.hold);
}

FitProblem fit_problem(const DenseProblem& problem, DelayModel delay) {
  FitProblem out;
  const double rate = problem.model.sample_rate_hz;
  out.lines = {2.0 * std::numbers::pi * problem.frequency_hz, rate > 0.0 ? 1.0 / rate : 0.0,
               problem.hold};
  out.n_outputs = problem.model.n_outputs();
  out.n_inputs = problem.model.n_inputs();
  out.G = problem.G;
  out.W = problem.W;
  for (const Submodel& s : problem.model.submodels)
    out.shapes.push_back({s.integrators, static_cast<int>(s.denominator.size()) - 1,
                          static_cast<int>(s.numerator.size()) - 1});
  out.delay = delay;
  return out;
}

Eigen::MatrixXd values(const std::optional<LineVariance>& variance) {
  Eigen::MatrixXd out(variance->matrix->rows(), variance->matrix->cols());
  for (Eigen::Index c = 0; c < out.rows(); ++c)
    out.row(c) = variance->channel(c).matrix().transpose();
  return out;
}

FitParameters fit_parameters(const DenseProblem& problem) {
  FitParameters beta;
  Eigen::Index functions = 0;
  for (const Submodel& s : problem.model.submodels) {
    beta.a.push_back(Eigen::Map<const Eigen::VectorXd>(
        s.denominator.data() + 1, static_cast<Eigen::Index>(s.denominator.size()) - 1));
    functions += static_cast<Eigen::Index>(s.numerator.size());
  }
  beta.input_delay_s = problem.model.input_delay_s;
  beta.output_delay_s = problem.model.output_delay_s;
  beta.B.resize(problem.channels(), functions);
  Eigen::Index f = 0;
  for (const Submodel& s : problem.model.submodels)
    for (const Eigen::MatrixXd& B : s.numerator) beta.B.col(f++) = B.reshaped();
  return beta;
}

FrfEstimate frf_of(const DenseProblem& problem) {
  FrfEstimate frf;
  frf.frequency_hz = problem.frequency_hz;
  frf.inputs = problem.model.inputs;
  frf.outputs = problem.model.outputs;
  frf.response = problem.G;
  frf.sample_rate_hz = problem.model.sample_rate_hz;
  frf.hold = problem.hold == HoldModel::none ? Hold::none : Hold::zoh;
  return frf;
}

void add_noise(FrfEstimate& frf, RandomNumbers& random) {
  for (Eigen::Index i = 0; i < frf.response.size(); ++i)
    frf.response(i) += std::sqrt(frf.noise_variance(i)) * random.circular();
}

void add_relative_noise(Eigen::MatrixXcd& response, double relative, RandomNumbers& random) {
  for (std::complex<double>& value : response.reshaped())
    value *= 1.0 + relative * random.circular();
}

FitOptions fit_options(Weighting weighting, HoldModel hold, DelayModel delay, double delay_s) {
  FitOptions options;
  options.weighting = weighting;
  options.hold = hold;
  options.delay = delay;
  options.delay_s = delay_s;
  return options;
}

}  // namespace stageid::test
