#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "estimation/model/basis.hpp"
#include "estimation/problem/fit_options.hpp"
#include "estimation/problem/fraction_columns.hpp"
#include "estimation/problem/shared_matrix.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

// Symbols (paper, section 2 and 3; method.md section 6):
//   N lines, n_c = n_y n_u channels (column-stacked), G data, W diagonal weights, E = G - P
//   F(k, j)   the numerator functions of all submodels, j = 1 .. n_f
//   B(c, j)   the numerator coefficients of channel c
//   D(k, .)   derivatives of F to the denominator coefficients

/// A variance of the data whose lines are divided by a number each, without a copy of it.
struct LineVariance {
  SharedMatrix<Eigen::MatrixXd> matrix;  ///< n_c x N
  Eigen::ArrayXd divisor;                ///< N

  Eigen::ArrayXd channel(Eigen::Index c) const;  ///< N
};

/// Data of a fit, channels as rows, one copy of them however many problems they belong to. Parts and
/// products are made tile by tile, in real arithmetic, since parameters are real.
struct FitProblem {
  ModelLines lines;
  Eigen::Index n_outputs = 0;
  Eigen::Index n_inputs = 0;
  SharedMatrix<Eigen::MatrixXcd> G;    ///< n_c x N
  SharedMatrix<Eigen::MatrixXd> W;     ///< n_c x N; see weights()
  std::optional<LineVariance> middle;  ///< v: the weights are W v W instead of W
  std::vector<SubmodelShape> shapes;
  std::vector<SubmodelRole> roles;  ///< one a submodel; empty: all searched
  std::vector<Eigen::Index> held;   ///< globals that are known and stay
  DelayModel delay = DelayModel::fixed;
  bool multiplied_out = false;  ///< no sums of fractions for few channels: all digits, more time
  int threads = 1;
  std::shared_ptr<SearchLimit> limit;  ///< every evaluation counts; empty: none

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

/// beta: everything that is estimated.
struct FitParameters {
  std::vector<Eigen::VectorXd> a;  ///< one a submodel, size its order
  Eigen::VectorXd input_delay_s;   ///< n_u
  Eigen::VectorXd output_delay_s;  ///< n_y; the last is the gauge and stays
  Eigen::MatrixXd B;               ///< n_c x n_f
};

/// Groups of fewer channels: what channels share costs more than it saves, unless functions are many.
constexpr Eigen::Index kFewChannels = 16;
constexpr Eigen::Index kManyFunctions = 64;

/// Channels that share one delay, and the functions that they see.
struct BasisGroup {
  double delay_s = 0.0;
  std::vector<Eigen::Index> channels;
  Eigen::MatrixXd F_re;  ///< N x n_f
  Eigen::MatrixXd F_im;
  Eigen::MatrixXd D_re;  ///< N x n_d, see DerivativeColumn; empty unless asked for
  Eigen::MatrixXd D_im;
  Eigen::MatrixXd T_re;  ///< N x n_f: derivative to the delay; empty unless delays are free
  Eigen::MatrixXd T_im;
  bool few = false;           ///< every channel's products are multiplied out by themselves
  FractionColumns fractions;  ///< unless few
};

/// What column of D belongs to what: dF_function / da_parameter, for the parameters that are not held.
struct DerivativeColumn {
  Eigen::Index function;
  Eigen::Index parameter;
};
std::vector<DerivativeColumn> derivative_columns(const FitProblem& problem);

/// Which globals delay a channel: none, the common one, or its input's and its output's.
std::vector<Eigen::Index> delay_parameters(const FitProblem& problem, Eigen::Index channel);

/// `beta` after a step of the globals; numerators stay.
FitParameters stepped(const FitProblem& problem, const FitParameters& beta,
                      const Eigen::Ref<const Eigen::VectorXd>& step);

/// Whether some channels are few but their functions many, so that multiplied_out makes a difference.
bool sums_fractions_of_few(const FitProblem& problem);

/// Evaluates the functions of every group of channels at the parameters.
std::vector<BasisGroup> evaluate_groups(const FitProblem& problem, const FitParameters& beta,
                                        bool with_derivatives);

/// The diagonal weights of a fit; for weight matrices their best diagonal. Variances from few degrees of freedom are smoothed over neighbouring
/// lines, so that a weight does not depend on the very noise that it weighs (facts.md section 8).
/// @throws std::invalid_argument if what the weighting needs is missing, zero or not finite.
SharedMatrix<Eigen::MatrixXd> make_weights(const FrfEstimate& frf, const FitOptions& options);

/// The variance v, n_c x N, for which W v W is E{W C W} on the average, W = make_weights() of a
/// variance that is itself an estimate: weight and variance come from the same sample. None where
/// variances do not weigh, or are exact (their degrees of freedom unknown). `frf` must outlive it.
std::optional<LineVariance> weighed_variance(const FrfEstimate& frf, Weighting weighting);

}  // namespace stageid
