#pragma once

#include <Eigen/Core>
#include <optional>
#include <stdexcept>

#include "estimation/model/hold_equivalent.hpp"
#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Weights that are not positive definite, so that the cost has no minimum. The data or the user's weights are wrong,
/// not the request: the program exits with code 3 and writes nothing.
class IndefiniteWeights : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// Hermitian weights W_k, n_c x n_c per line, of the cost 1/(2N) sum vec(E)^H W_k vec(E), stored
/// as given: whole, or as the two factors of a likelihood,
///   W_k = S_k^-1 kron C_E^-1,   for which the sum is  sum_k || C_E^-1/2 (G_k - P_k) U_k ||_F^2
/// for one realization, S = [(U U^H)^-1]^T (docs/theory.md, section 7).
class WeightMatrices {
 public:
  /// From residual_covariance and input_factor. C_E is smoothed over neighbouring lines until its degrees of freedom
  /// nu suffice for an inverse, and the inverse of a complex Wishart matrix is corrected: E{C_hat^-1} = nu / (nu -
  /// n_y) C^-1.
  /// @throws std::invalid_argument if one of them is missing or the whole band has too few degrees of freedom;
  /// IndefiniteWeights (naming the line) if one is not positive definite.
  static WeightMatrices likelihood(const FrfEstimate& frf);

  /// Matrices of the user: (n_c n_c) x N, column k = vec(W_k).
  /// @throws std::invalid_argument if they do not match the response, are too large for memory, or (naming the line)
  /// not finite or not Hermitian; IndefiniteWeights (naming the line) if not positive semidefinite.
  static WeightMatrices user(const FrfEstimate& frf, const Eigen::MatrixXcd& W);

  /// Multiplies column j of `tile` (n_c x lines) by W_k, k = first + j.
  void apply(Eigen::Index first, Eigen::MatrixXcd& tile) const;

  /// W_k(c, d) of two channels on some lines, lines x 1.
  SplitMatrix between(Eigen::Index c, Eigen::Index d, Eigen::Index first, Eigen::Index lines) const;

  /// Their best diagonal approximation, n_c x N: 1 / (W_k^-1)_cc, the inverse variance of the channel if W_k = Cov(vec
  /// G)^-1; W_cc if a W_k of the user is singular.
  const Eigen::MatrixXd& marginal() const noexcept { return marginal_; }

  /// Factor by which the scatter of the estimated weights raises the covariance of an estimate: E{W C W} / E{W}, see
  /// weight_matrices.cpp. 1 if they are exact.
  double scatter_factor() const noexcept { return scatter_factor_; }

 private:
  Eigen::Index n_outputs_ = 0;
  Eigen::MatrixXcd outputs_;  // vec(C_E^-1) x N
  Eigen::MatrixXcd inputs_;   // vec((S^-1)^T) x N
  Eigen::MatrixXcd whole_;    // vec(W_k) x N, instead of those two
  Eigen::MatrixXd marginal_;
  double scatter_factor_ = 1.0;
};

/// The matrices that `options` requests; none with a diagonal weighting.
std::optional<WeightMatrices> make_weight_matrices(const FrfEstimate& frf,
                                                   const FitOptions& options);

/// @throws std::invalid_argument naming the required memory, if whole matrices for `lines` lines of `channels`
/// channels are too large.
void require_memory_for_weight_matrices(Eigen::Index channels, Eigen::Index lines);

/// C_E of every line and its degrees of freedom; 0: exact.
struct SmoothedCovariance {
  Eigen::MatrixXcd matrices;  ///< (n_y n_y) x N
  double dof = 0.0;
};
/// Residual covariance averaged over as many neighbouring lines as its inverse needs: its correlations arithmetically,
/// its variances geometrically, without bias, as make_weights() does. @pre its variances are positive.
SmoothedCovariance smoothed_residual_covariance(const FrfEstimate& frf);

}  // namespace stageid
