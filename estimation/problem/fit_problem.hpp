#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "estimation/model/basis.hpp"
#include "estimation/problem/fit_options.hpp"
#include "estimation/problem/fraction_columns.hpp"
#include "estimation/problem/shared_matrix.hpp"
#include "excitation/threads/team.hpp"
#include "excitation/threads/worker_pool.hpp"
#include "frf/response/channel_tiles.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

// Symbols (paper, sections 2 and 3):
//   N lines, n_c = n_y n_u channels (column-stacked), G data, W diagonal weights, E = G - P
//   F(k, j)   the numerator functions of all submodels, j = 1 .. n_f
//   B(c, j)   the numerator coefficients of channel c
//   D(k, .)   derivatives of F to the denominator coefficients

/// 0 to count - 1 in ranges of at most `most`.
std::vector<DataRange> ranges_of(Eigen::Index count, Eigen::Index most);

/// The sum of task(range), the tasks in parallel. It is added in order, so it does not depend on the number of threads.
/// @pre there are ranges
template <typename Range, typename Task>
auto ordered_sum(const std::vector<Range>& ranges, int threads, const Task& task) {
  std::vector<decltype(task(ranges[0]))> parts(ranges.size());
  for_each_task(threads, static_cast<int>(ranges.size()),
                [&](int i) { parts[i] = task(ranges[i]); });
  for (std::size_t i = 1; i < parts.size(); ++i) parts[0] += parts[i];
  return std::move(parts[0]);
}

/// A variance of the data whose lines are divided by one number each, without copying it.
struct LineVariance {
  SharedMatrix<Eigen::MatrixXd> matrix;  ///< n_c x N
  Eigen::ArrayXd divisor;                ///< N

  Eigen::ArrayXd channel(Eigen::Index c) const;  ///< N
};

/// Data of a fit, channels as rows; several problems can share one copy. Parts and products are computed tile by tile,
/// in real arithmetic, since parameters are real.
struct FitProblem {
  ModelLines lines;
  Eigen::Index n_outputs = 0;
  Eigen::Index n_inputs = 0;
  SharedMatrix<Eigen::MatrixXcd> G;    ///< n_c x N; with W and v, see ChannelData
  SharedMatrix<Eigen::MatrixXd> W;     ///< n_c x N; see weights()
  std::optional<LineVariance> middle;  ///< v: the weights are W v W instead of W
  std::vector<SubmodelShape> shapes;
  std::vector<SubmodelRole> roles;  ///< one per submodel; empty: all searched
  std::vector<Eigen::Index> held;   ///< globals that are known and fixed
  DelayModel delay = DelayModel::fixed;
  int threads = 1;
  const Team* team =
      &Team::one();  ///< each process sums over the tiles of channels that are its own
  std::shared_ptr<SearchLimit> limit;  ///< each evaluation counts; empty: no limit

  Eigen::Index channels() const noexcept { return G->rows(); }
  Eigen::Index size() const noexcept { return G->cols(); }
  Eigen::VectorXd weights(Eigen::Index channel) const;  ///< N
  Eigen::Index functions() const noexcept;              ///< n_f
  Eigen::Index denominators() const noexcept;           ///< number of denominator coefficients
  Eigen::Index delays() const noexcept;  ///< number of free delays: 0, 1 or n_y + n_u - 1
  bool is_held(Eigen::Index global) const noexcept;
  Eigen::Index globals() const noexcept { return denominators() + delays(); }
  Eigen::Index parameters() const noexcept { return globals() + channels() * functions(); }
};

/// beta: all estimated parameters.
struct FitParameters {
  std::vector<Eigen::VectorXd> a;  ///< one per submodel, size its order
  Eigen::VectorXd input_delay_s;   ///< n_u
  Eigen::VectorXd output_delay_s;  ///< n_y; the last is the gauge and is held
  Eigen::MatrixXd B;               ///< n_c x n_f
};

/// Channels with the same delay, and the functions evaluated with that delay.
struct BasisGroup {
  double delay_s = 0.0;
  std::vector<Eigen::Index> channels;
  SplitMatrix F;  ///< N x n_f
  SplitMatrix D;  ///< N x n_d, see DerivativeColumn; empty unless requested
  SplitMatrix T;  ///< N x n_f: derivative to the delay; empty unless delays are free
  FractionColumns fractions;
};

/// Meaning of a column of D: dF_function / da_parameter, for the parameters that are not held.
struct DerivativeColumn {
  Eigen::Index function;
  Eigen::Index parameter;
};
std::vector<DerivativeColumn> derivative_columns(const FitProblem& problem);

/// The globals that are delays of a channel: none, the common one, or those of its input and its output.
std::vector<Eigen::Index> delay_parameters(const FitProblem& problem, Eigen::Index channel);

/// `beta` after a step of the globals; numerators unchanged.
FitParameters stepped(const FitProblem& problem, const FitParameters& beta,
                      const Eigen::Ref<const Eigen::VectorXd>& step);

/// Evaluates the functions of every group of channels at the parameters.
std::vector<BasisGroup> evaluate_groups(const FitProblem& problem, const FitParameters& beta,
                                        bool with_derivatives);

/// The same for one group after the other. Many are evaluated a few at a time: with a delay per channel, all of them
/// together would need many times the memory of the data.
class BasisGroups {
 public:
  /// Both must outlive this.
  BasisGroups(const FitProblem& problem, const FitParameters& beta, bool with_derivatives);
  /// Groups that are already evaluated, and kept elsewhere.
  BasisGroups(const std::vector<BasisGroup>& evaluated)  // NOLINT: they are such groups
      : evaluated_(&evaluated) {}

  /// Calls visit(group) in the order of evaluate_groups().
  void for_each(const std::function<void(const BasisGroup&)>& visit) const;

 private:
  const std::vector<BasisGroup>* evaluated_ = nullptr;  // null: not yet
  const FitProblem* problem_ = nullptr;
  const FitParameters* beta_ = nullptr;
  bool with_derivatives_ = false;
};

/// The group of every channel.
std::vector<const BasisGroup*> groups_of_channels(const FitProblem& problem,
                                                  const std::vector<BasisGroup>& groups);

/// sum W |G|^2. @param weights n_c x N
double weighted_power(const FrfEstimate& frf, const Eigen::MatrixXd& weights);

/// Whether the weight of an own channel is zero on all lines, so that the data do not determine it.
bool has_no_weight(const FitProblem& problem, Eigen::Index channel);

/// sum W |E|^2 per complex degree of freedom; 1 if W is the inverse variance and the model is right.
double residual_per_degree(const FitProblem& problem, double cost, Eigen::Index parameters);

/// The diagonal weights of a fit; for weight matrices, their best diagonal. Variances with few degrees of freedom are
/// smoothed over neighbouring lines, so that a weight does not depend on the noise of its own line.
/// @throws std::invalid_argument if data required by the weighting are missing, zero or not finite.
SharedMatrix<Eigen::MatrixXd> make_weights(const FrfEstimate& frf, const FitOptions& options);

/// The variance v, n_c x N, for which W v W equals E{W C W} on average, with W = make_weights() of an estimated
/// variance: weight and variance come from the same sample. Empty if the weights are not inverse variances, or if the
/// variances are exact (unknown degrees of freedom). `frf` must outlive it.
std::optional<LineVariance> weighed_variance(const FrfEstimate& frf, Weighting weighting);

}  // namespace stageid
