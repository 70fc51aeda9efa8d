#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "tests/support/models/model_fit_problem.hpp"

namespace stageid::test {

/// Fills the numerators at random, measures the model with noise, weighs arbitrarily, and then moves
/// every parameter away: poles by 3 %, numerators by 30 %. Nothing is at an optimum.
inline void measure_and_disturb(RandomNumbers& random, DenseProblem& problem, double time_scale_s) {
  for (Submodel& s : problem.model.submodels) {
    double size = std::pow(time_scale_s, -s.integrators);
    for (Eigen::MatrixXd& B : s.numerator) {
      B = size * random_matrix(random, B.rows(), B.cols());
      size *= time_scale_s;
    }
  }
  measure(problem);
  const double scale = problem.G.cwiseAbs().mean();
  problem.W.resize(problem.G.rows(), problem.G.cols());
  for (Eigen::Index k = 0; k < problem.G.cols(); ++k)
    for (Eigen::Index c = 0; c < problem.G.rows(); ++c) {
      problem.G(c, k) += 0.05 * scale * random.circular();
      problem.W(c, k) = std::exp(random.normal()) / (scale * scale);
    }
  for (Submodel& s : problem.model.submodels) {
    for (std::size_t q = 1; q < s.denominator.size(); ++q)
      s.denominator[q] *= 1.0 + 0.03 * random.normal();
    for (Eigen::MatrixXd& B : s.numerator)
      B.array() *= 1.0 + 0.3 * random_matrix(random, B.rows(), B.cols()).array();
  }
}

/// A problem evaluated at the parameters of its model.
struct Evaluated {
  FitProblem fit;
  FitParameters beta;
  std::vector<BasisGroup> groups;
  explicit Evaluated(const DenseProblem& problem, DelayModel delay = DelayModel::fixed,
                     bool derivatives = true)
      : fit(fit_problem(problem, delay)),
        beta(fit_parameters(problem)),
        groups(evaluate_groups(fit, beta, derivatives)) {}
};

}  // namespace stageid::test
