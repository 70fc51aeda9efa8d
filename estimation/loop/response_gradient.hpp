#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// The derivatives of the response of a model behind the exact hold to its parameters, on given lines. The parameters
/// and their order are those of FitCovariance: denominator coefficients, free delays, vec B (channels x functions).
class ResponseGradient {
 public:
  /// @param parameters rows of the covariance; the number of free delays follows from it
  /// @throws std::invalid_argument if the model cannot have as many parameters, or has no sample rate
  ResponseGradient(const AdditiveModel& model, Eigen::Index parameters,
                   const Eigen::VectorXd& frequency_hz);
  /// d g / d parameters, parameters x functions, of functions g of the response on line k.
  /// @param weights dg = sum_c weights(c) dP_c, channels x functions, channel c = output + n_y input
  Eigen::MatrixXcd of(Eigen::Index k, const Eigen::MatrixXcd& weights) const;
  Eigen::Index parameters() const noexcept { return problem_.parameters(); }

 private:
  FitProblem problem_;  ///< as of a fit, without data
  FitParameters beta_;
  std::vector<BasisGroup> groups_;
};

}  // namespace stageid
