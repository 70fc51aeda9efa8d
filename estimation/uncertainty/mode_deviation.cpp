#include "estimation/uncertainty/mode_deviation.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/model/poles.hpp"

namespace stageid {
namespace {

/// Free delays are the last globals; one delay of the plant is that of every input.
void fill_delay_deviations(const FitProblem& problem, const Eigen::MatrixXd& globals,
                           AdditiveModel& model) {
  if (problem.delays() == 0) return;
  const Eigen::VectorXd deviation =
      globals.diagonal().tail(problem.delays()).cwiseMax(0.0).cwiseSqrt();
  const bool common = problem.delay == DelayModel::estimate;
  model.input_delay_std_s.setConstant(problem.n_inputs, deviation[0]);
  model.output_delay_std_s.setZero(problem.n_outputs);
  if (common) return;
  model.input_delay_std_s = deviation.head(problem.n_inputs);
  model.output_delay_std_s.head(problem.n_outputs - 1) = deviation.tail(problem.n_outputs - 1);
}

}  // namespace

void fill_deviations(const FitProblem& problem, const ParameterCovariance& covariance,
                     AdditiveModel& model) {
  fill_delay_deviations(problem, covariance.globals, model);
  Eigen::Index first = 0;
  Eigen::Index f = 0;
  for (Submodel& s : model.submodels) {
    const auto order = static_cast<Eigen::Index>(s.denominator.size()) - 1;
    if (s.is_mode()) {
      const Eigen::Matrix2d C = covariance.globals.block<2, 2>(first, first);
      const double a1 = s.denominator[1];
      const double a2 = s.denominator[2];
      const Eigen::Vector2d df(0.0, -0.5 * s.natural_frequency_hz() / a2);
      const Eigen::Vector2d dz = s.damping_ratio() * Eigen::Vector2d(1.0 / a1, -0.5 / a2);
      // Zero: the mode is at a bound, so the data do not determine its frequency or damping.
      if (C(1, 1) > 0.0) s.natural_frequency_std_hz = std::sqrt(std::max(0.0, df.dot(C * df)));
      if (C(1, 1) > 0.0 && C(0, 0) > 0.0)
        s.damping_ratio_std = std::sqrt(std::max(0.0, dz.dot(C * dz)));
    } else if (order > 0) {
      const Eigen::MatrixXd C = covariance.globals.block(first, first, order, order);
      if (C.diagonal().minCoeff() > 0.0)
        s.poles = pole_estimates(Eigen::Map<const Eigen::VectorXd>(&s.denominator[1], order), C);
    }
    first += order;
    for (const Eigen::MatrixXd& B : s.numerator)
      s.numerator_std.emplace_back(
          covariance.numerator_variance.col(f++)
              .unaryExpr([](double v) { return v < 0.0 ? 0.0 : std::sqrt(v); })
              .reshaped(B.rows(), B.cols()));
  }
}

}  // namespace stageid
