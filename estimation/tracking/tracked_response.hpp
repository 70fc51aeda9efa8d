#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/model/hold_equivalent.hpp"
#include "estimation/tracking/tracked_parameters.hpp"

namespace stageid {

/// The response of a model whose tracked parameters have changed, on given lines: Y = P(x) U, and its derivatives to x.
class TrackedResponse {
 public:
  /// @param lines of the data; a model without hold is evaluated with the exact one, as the samples have it
  TrackedResponse(const AdditiveModel& model, std::vector<TrackedParameter> parameters,
                  const Eigen::VectorXd& frequency_hz);

  const AdditiveModel& model() const noexcept { return model_; }
  const std::vector<TrackedParameter>& parameters() const noexcept { return parameters_; }
  Eigen::Index size() const noexcept { return std::ssize(parameters_); }
  Eigen::Index lines() const noexcept { return lines_.omega_rad_s.size(); }
  const Eigen::VectorXd& omega_rad_s() const noexcept { return lines_.omega_rad_s; }

  /// P(x), (n_y n_u) x N, column k = vec(P_k).
  Eigen::MatrixXcd at(const Eigen::VectorXd& x) const;
  /// The share of one submodel of P(x).
  Eigen::MatrixXcd at(const Eigen::VectorXd& x, Eigen::Index submodel) const;
  /// Y, n_y x N, of such a response. @param U n_u x N
  static Eigen::MatrixXcd outputs(const Eigen::MatrixXcd& P, const Eigen::MatrixXcd& U);
  /// dY/dx at x, (n_y N) x parameters, rows as in the n_y x N matrix.
  Eigen::MatrixXcd derivatives(const Eigen::VectorXd& x, const Eigen::MatrixXcd& U) const;

 private:
  struct Changes;  // x by its meaning
  Changes changes(const Eigen::VectorXd& x) const;
  Submodel changed(std::size_t submodel, const Changes& change) const;
  Eigen::MatrixXcd response_of(AdditiveModel model, const Changes& change) const;

  AdditiveModel model_;
  std::vector<TrackedParameter> parameters_;
  ModelLines lines_;
};

}  // namespace stageid
