#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/problem/shared_matrix.hpp"

namespace stageid {

/// Weights W of the cost 1/(2N) sum vec(E)^H W vec(E).
enum class Weighting : std::uint8_t {
  unit,
  inverse_magnitude,  ///< 1/|G|: the paper's
  relative,           ///< 1/|G|^2
  noise_variance,     ///< 1/noise_variance: maximum likelihood for a linear plant
  total_variance,     ///< 1/total_variance
  likelihood,         ///< S^-1 kron C_E^-1: the same with the correlations of the noise
  user                ///< FitOptions::user_weights or user_weight_matrices
};
const char* to_string(Weighting weighting) noexcept;

enum class FitMethod : std::uint8_t {
  riv,  ///< the paper's refined instrumental variables
  gn,   ///< Gauss-Newton
  sk    ///< Sanathanan-Koerner: biased fixed point, for comparison
};
const char* to_string(FitMethod method) noexcept;

class SearchLimit;

enum class DelayModel : std::uint8_t { fixed, estimate, per_channel };

/// What to fit and how. Checked once by fit_additive_model().
struct FitOptions {
  Weighting weighting = Weighting::relative;
  SharedMatrix<Eigen::MatrixXd> user_weights;  ///< (n_y n_u) x N: the diagonals of W_k
  /// (n_c n_c) x N, n_c = n_y n_u: column k = vec(W_k), Hermitian; used instead unless empty
  Eigen::MatrixXcd user_weight_matrices;
  HoldModel hold = HoldModel::none;
  DelayModel delay = DelayModel::fixed;
  double delay_s = 0.0;  ///< fixed: the delay; else the start (0 for estimate: searched)
  FitMethod method = FitMethod::riv;
  int residue_rank = 0;     ///< of every mode; 0: free
  int rigid_body_rank = 0;  ///< of the submodel with integrators; 0: free
  /// Of modes one by one, an entry a submodel, 0: residue_rank. The fit then begins at the start's residues, without
  /// a fit of free ones, which modes at one place do not have.
  std::vector<int> mode_ranks = {};
  int max_iterations = 100;
  double gradient_tolerance = 1e-9;  ///< scaled: max_i |e_i| / sqrt(M_ii 2N cost)
  double step_tolerance = 1e-10;     ///< largest relative change of a pole, and of the cost
  /// Largest distance of a parameter from the stationary point, in standard deviations (Newton decrement).
  double deviation_tolerance = 1e-4;
  bool shrink_hidden = false;     ///< searched modes with held poles: shrink_hidden_modes()
  bool judge_modes = false;       ///< modes were asked for one by one: undetermined if one is
  bool uncertainty = true;        ///< also standard deviations and the variance of the response
  bool response_variance = true;  ///< false: of those only the standard deviations
  bool covariance = false;        ///< also FitResult::covariance
  int threads = 0;                ///< 0: all cores; the result does not depend on it
  std::function<void(int iteration, double cost)> progress;
  std::function<bool()>
      interrupted;  ///< looked at between steps; then the best model so far is completed
  std::shared_ptr<SearchLimit>
      limit;  ///< of the search that the fit belongs to; made by automatic_fit()
};

enum class FitStatus : std::uint8_t {
  gradient_small,
  step_small,
  cost_stalled,
  iteration_limit,
  singular,
  undetermined,  ///< converged, but the data do not determine a mode or a submodel that was asked for
  unexplained,    ///< converged, but the model leaves clearly more than noise and known distortion
  faulty_data,    ///< the health of the data has a fault: they are not what they say
  search_budget,  ///< the search used its budget, see SearchLimit
  interrupted     ///< by the user, see SearchLimit
};
const char* to_string(FitStatus status) noexcept;
/// Whether a fit that ended so may be trusted.
bool is_trustworthy(FitStatus status) noexcept;
/// The same of a model's record. Without a status (a model that another program wrote) nothing speaks against it.
bool is_trustworthy(const FitRecord& record);

/// All that is known of a fit's parameters and response, see dense_covariances(). Parameters: denominator
/// coefficients in the order of the submodels, free delays, vec B (channels x functions).
struct FitCovariance {
  Eigen::MatrixXd sandwich;           ///< of the estimate: what standard deviations are taken from
  Eigen::MatrixXd likelihood;         ///< [2 sum Re{J^H W J}]^-1
  Eigen::MatrixXd response_variance;  ///< (n_y n_u) x N: E|dP|^2
  Eigen::MatrixXd response_radius;    ///< that |dP| stays below with probability 0.95
};

/// The rank that the data ask of a mode's residue.
struct ResidueRankTest {
  std::size_t submodel = 0;  ///< of the fit with free residues
  double natural_frequency_hz = 0.0;
  int rank = 1;              ///< the smallest that is not contradicted
  double chi_square = 0.0;   ///< of what the residue has beside its best approximation of rank one
  int parameters = 0;        ///< its degrees of freedom where the residue is of rank one
  double probability = 1.0;  ///< that noise alone gives so much
};

/// A fit that did not converge is a result, not an error: look at `status`.
struct FitResult {
  AdditiveModel
      model;  ///< the iterate of least cost, with standard deviations where variances are known
  FitStatus status = FitStatus::iteration_limit;
  std::string message = "fit_additive_model was not called";
  Eigen::Index parameters = 0;         ///< free ones
  std::vector<double> cost;            ///< one entry an iterate, the start first
  std::vector<std::string> decisions;  ///< what an automatic fit chose, and why, in order
  std::vector<std::string> findings;   ///< of these, what the user should do something about
  std::vector<ResidueRankTest>
      residue_ranks;  ///< where residues were free and deviations asked for
  /// By how much sum W |E|^2 (W diagonal, or the best diagonal) would rise without a submodel, the others re-solved; one entry each.
  std::vector<double> removal_cost;
  std::vector<std::size_t> held;     ///< submodels with a pole at a bound, or held by request
  std::vector<Eigen::Index> frozen;  ///< denominator coefficients that stood at a bound at the end
  /// (n_y n_u) x N: of P, from the parameter covariance; empty if it is not known or not asked for.
  Eigen::MatrixXd response_variance;
  FitCovariance
      covariance;  ///< empty unless asked for; where it cannot be told, a decision says why
  bool trustworthy() const noexcept { return is_trustworthy(status); }
  /// Adds a reason not to trust the fit, to status, message and the model's record. The gravest reason is the status and
  /// comes first in the message: an interrupt, faulty data, a budget, then no convergence, then an unexplained residual, then undetermined modes.
  void distrust(FitStatus why, const std::string& reason);
};

}  // namespace stageid
