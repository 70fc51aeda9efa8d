#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/model/additive_model.hpp"

// The paper's estimator as printed: dense, line by line, all K right-hand sides. Only for
// problems of a few parameters; shares nothing with the library but the structs and a solver of linear equations.

namespace stageid::test {

/// A model and the data to fit.
struct DenseProblem {
  AdditiveModel model;
  Eigen::VectorXd frequency_hz;
  HoldModel hold = HoldModel::none;
  Eigen::MatrixXcd G;  ///< n_c x N
  Eigen::MatrixXd W;   ///< n_c x N, the diagonals of W(omega_k)

  Eigen::Index channels() const { return G.rows(); }
};

/// beta = [theta_1; ...; theta_K], theta_i = [a_i1 ... a_in; vec B_i0; ...; vec B_im].
Eigen::VectorXd beta_of(const AdditiveModel& model);

/// Where theta_i starts in beta, K + 1 entries.
std::vector<Eigen::Index> first_of_theta(const AdditiveModel& model);

/// Phih^H on line k, n_c x n_beta: columns dP/dbeta = [-s^q p_i / A_i, s^m / (s^l A_i) I].
Eigen::MatrixXcd instrument_rows(const DenseProblem& problem, Eigen::Index k);

/// Phi^T on line k, n_c x n_beta: columns [-s^q g_i / A_i, s^m / (s^l A_i) I], g_i = vec(G - P +
/// P_i).
Eigen::MatrixXcd regressor_rows(const DenseProblem& problem, Eigen::Index k);

/// The left factor of W in the paper's estimator: the instrument (refined instrumental variables), or the regressor
/// itself (Sanathanan and Koerner).
enum class Left { instrument, regressor };

/// The K-column solution of
///   sum Re{ left W Phi^T } Beta = sum Re{ left W Upsilon^T },
/// Upsilon^T = [g_1 / A_1, ..., g_K / A_K], and of it the block diagonal: the paper's next beta.
struct PaperStep {
  Eigen::MatrixXd solution;  ///< n_beta x K
  Eigen::VectorXd next_beta;
};
PaperStep paper_step(const DenseProblem& problem, Left left);

/// The Gauss-Newton step [sum Re{J^H W J}]^-1 sum Re{J^H W vec E}.
Eigen::VectorXd gauss_newton_step(const DenseProblem& problem);

/// Left-hand side of the first-order condition, scaled: max_i |r_i| / sqrt(M_ii sum vec(E)^H W
/// vec(E)) with r = sum Re{J^H W vec E}, M = sum Re{J^H W J}. `common_delay`: one delay of all
/// channels is free too, its column from finite differences.
double first_order_condition(const DenseProblem& problem, bool common_delay);

}  // namespace stageid::test
