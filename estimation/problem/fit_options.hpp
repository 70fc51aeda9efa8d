#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/problem/shared_matrix.hpp"
#include "excitation/words/words.hpp"

namespace stageid {

/// Weights W of the cost 1/(2N) sum vec(E)^H W vec(E).
enum class Weighting : std::uint8_t {
  unit,
  inverse_magnitude,  ///< 1/|G|, as in the paper
  relative,           ///< 1/|G|^2
  noise_variance,     ///< 1/noise_variance: maximum likelihood for a linear plant
  total_variance,     ///< 1/total_variance
  likelihood,         ///< S^-1 kron C_E^-1: maximum likelihood with correlated noise
  user                ///< FitOptions::user_weights or user_weight_matrices
};
template <>
inline constexpr std::array kWords<Weighting> = {
    "unit",           "inverse_magnitude", "relative", "noise_variance",
    "total_variance", "likelihood",        "user"};

/// True if the weighting is defined as the inverse covariance of the noise.
constexpr bool weighs_by_variance(Weighting weighting) noexcept {
  return weighting == Weighting::noise_variance || weighting == Weighting::total_variance ||
         weighting == Weighting::likelihood;
}

enum class FitMethod : std::uint8_t {
  riv,  ///< refined instrumental variables, as in the paper
  gn,   ///< Gauss-Newton
  sk    ///< Sanathanan-Koerner: biased fixed point, for comparison
};
template <>
inline constexpr std::array kWords<FitMethod> = {"riv", "gn", "sk"};

class SearchLimit;
class Team;
struct CovarianceParts;
struct Workers;

enum class DelayModel : std::uint8_t { fixed, estimate, per_channel };
template <>
inline constexpr std::array kWords<DelayModel> = {"fixed", "estimate", "per_channel"};

/// Options of a fit, checked once by fit_additive_model().
struct FitOptions {
  Weighting weighting = Weighting::relative;
  SharedMatrix<Eigen::MatrixXd> user_weights;  ///< (n_y n_u) x N: the diagonals of W_k
  /// (n_c n_c) x N, n_c = n_y n_u: column k = vec(W_k), Hermitian; replaces user_weights unless empty
  Eigen::MatrixXcd user_weight_matrices;
  HoldModel hold = HoldModel::none;
  DelayModel delay = DelayModel::fixed;
  double delay_s = 0.0;  ///< if fixed: the delay; else the start value (0 for estimate: searched)
  FitMethod method = FitMethod::riv;
  int residue_rank = 0;     ///< of every mode; 0: free
  int rigid_body_rank = 0;  ///< of the submodel with integrators; 0: free
  /// Ranks per submodel, 0: residue_rank. The fit then starts from the residues of the start model, without a fit of
  /// free residues, which does not exist for modes at the same frequency.
  std::vector<int> mode_ranks = {};
  int max_iterations = 100;
  double gradient_tolerance = 1e-9;  ///< scaled: max_i |e_i| / sqrt(M_ii 2N cost)
  double step_tolerance = 1e-10;     ///< largest relative change of a pole, and of the cost
  /// Largest distance of a parameter from the stationary point, in standard deviations (Newton decrement).
  double deviation_tolerance = 1e-4;
  /// A trial: the fit ends when it can no longer be expected to reach this cost.
  double worthwhile_cost = HUGE_VAL;
  bool shrink_hidden = false;  ///< searched modes with held poles: shrink_hidden_modes()
  bool judge_modes = false;    ///< modes were requested one by one: undetermined if one of them is
  bool uncertainty = true;     ///< also standard deviations and the variance of the response
  bool response_variance = true;  ///< false: only the standard deviations
  bool covariance = false;        ///< also FitResult::covariance
  int threads = 0;                ///< 0: all cores; the result does not depend on it
  const Team* team = nullptr;     ///< of processes that share the channels; null: one
  std::function<void(int iteration, double cost)> progress;
  std::function<bool()>
      interrupted;  ///< checked between steps; then the best model so far is completed
  std::shared_ptr<SearchLimit>
      limit;  ///< of the search that this fit is part of; created by automatic_fit()

  Workers workers() const;
};

/// Covariances of the parameters and the response of a fit, see dense_covariances(). Parameters: denominator
/// coefficients in the order of the submodels, free delays, vec B (channels x functions).
struct FitCovariance {
  Eigen::MatrixXd sandwich;                ///< of the estimate; source of the standard deviations
  Eigen::MatrixXd likelihood;              ///< [2 sum Re{J^H W J}]^-1
  Eigen::MatrixXd response_variance = {};  ///< (n_y n_u) x N: E|dP|^2
  Eigen::MatrixXd response_radius = {};    ///< |dP| is below this with probability 0.95
};

/// The rank of the residue of a mode that the data require.
struct ResidueRankTest {
  std::size_t submodel = 0;  ///< index in the fit with free residues
  double natural_frequency_hz = 0.0;
  int rank = 1;              ///< the smallest rank that the data do not contradict
  double chi_square = 0.0;   ///< of the residue minus its best rank-one fit
  int parameters = 0;        ///< its degrees of freedom for a residue of rank one
  double probability = 1.0;  ///< probability that noise alone gives at least this
};

/// Outcome of a fit. A fit that did not converge is a result, not an error: check trustworthy().
struct FitResult {
  AdditiveModel
      model;  ///< the iterate of least cost, with standard deviations if variances are known
  Eigen::Index parameters = 0;           ///< free ones
  DelayModel delay = DelayModel::fixed;  ///< of these, the delays
  std::vector<double> cost;              ///< one entry per iterate, the start first
  /// Distance from the stationary point before the last step, in standard deviations (Newton decrement).
  double deviations = HUGE_VAL;
  std::vector<std::string> decisions;  ///< choices of an automatic fit and their reasons, in order
  std::vector<std::string> findings;   ///< the decisions on which the user should act
  std::vector<ResidueRankTest> residue_ranks;  ///< if residues were free and deviations requested
  /// Rise of sum W |E|^2 (W diagonal, or the best diagonal) without a submodel, the others re-solved; one per
  /// submodel.
  std::vector<double> removal_cost;
  std::vector<std::size_t> held;     ///< submodels with a pole at a bound, or held by request
  std::vector<Eigen::Index> frozen;  ///< denominator coefficients that were at a bound at the end
  /// (n_y n_u) x N: variance of P, from the parameter covariance; empty if unknown or not requested.
  Eigen::MatrixXd response_variance;
  FitCovariance
      covariance;  ///< empty unless requested; if it cannot be computed, a decision contains the reason
  /// What dense_covariances() computes those of free numerators from; empty if not kept.
  std::shared_ptr<const CovarianceParts> covariance_parts;
  FitStatus status() const noexcept {
    return model.fit.status.value_or(FitStatus::iteration_limit);
  }
  const std::string& message() const noexcept { return model.fit.message; }
  bool trustworthy() const noexcept { return model.fit.status && model.fit.trustworthy(); }
  bool is_held(std::size_t submodel) const noexcept {
    return std::ranges::find(held, submodel) != held.end();
  }
};

}  // namespace stageid
