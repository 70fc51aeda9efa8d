#include "estimation/uncertainty/low_rank_covariance.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "excitation/decompositions/decompositions.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

/// The free parameters that some channels depend on, in order.
std::vector<Eigen::Index> parameters_of(const FitProblem& problem, const FitParameters& beta,
                                        const ResidueFactors& factors, Eigen::Index first_channel,
                                        Eigen::Index channels) {
  std::vector<Eigen::Index> own = indices(0, problem.globals());
  for (Eigen::Index c = first_channel; c < first_channel + channels; ++c)
    for (const ResidueFactors::Entry& t : factors.channel_entries(beta, c))
      own.push_back(t.parameter);
  std::ranges::sort(own);
  own.erase(std::unique(own.begin(), own.end()), own.end());
  return own;
}

/// Columns d vec(P)_c / d own parameters, lines x own.
SplitMatrix free_columns(const FitProblem& problem, const FitParameters& beta,
                         const ResidueFactors& factors, const BasisGroup& group, Eigen::Index c,
                         const std::vector<Eigen::Index>& own, DataRange lines) {
  SplitMatrix out = global_columns(problem, beta, group, c, lines);
  const auto n = std::ssize(own);
  out.re.conservativeResizeLike(Eigen::MatrixXd::Zero(lines.count, n));
  out.im.conservativeResizeLike(Eigen::MatrixXd::Zero(lines.count, n));
  for (const auto& [function, parameter, value] : factors.channel_entries(beta, c)) {
    const auto at = std::ranges::lower_bound(own, parameter) - own.begin();
    out.re.col(at) += value * group.F.re.col(function).segment(lines.first, lines.count);
    out.im.col(at) += value * group.F.im.col(function).segment(lines.first, lines.count);
  }
  return out;
}

/// T^T K T with correlated channels.
Eigen::MatrixXd correlated_middle(const FitProblem& problem, const FitParameters& beta,
                                  const std::vector<BasisGroup>& groups,
                                  const ResidueFactors& factors, const DataNoise& noise) {
  const Eigen::Index n_y = problem.n_outputs;
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, groups);
  CorrelatedColumns inputs;
  for (Eigen::Index u = 0; u < problem.n_inputs; ++u)
    inputs.parameters.push_back(parameters_of(problem, beta, factors, n_y * u, n_y));
  inputs.columns = [&](Eigen::Index u, Eigen::Index y, DataRange lines) {
    const Eigen::Index c = y + n_y * u;
    return noise_scaled(
        problem, noise, c, lines,
        free_columns(problem, beta, factors, *group_of[c], c, inputs.parameters[u], lines));
  };
  return correlated_gram(problem, noise.correlation, factors.size(), inputs);
}

/// Variances of the numerators of one channel: rows of T over its functions.
Eigen::VectorXd numerator_variances(const FitProblem& problem, const FitParameters& beta,
                                    const ResidueFactors& factors, Eigen::Index c,
                                    const Eigen::MatrixXd& C) {
  const std::vector<ResidueFactors::Entry> entries = factors.channel_entries(beta, c);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(problem.functions());
  for (const ResidueFactors::Entry& t : entries)
    for (const ResidueFactors::Entry& o : entries)
      if (t.function == o.function)
        out[t.function] += t.value * C(t.parameter, o.parameter) * o.value;
  return out;
}

/// R with N^-1 = R R^T on the free parameters. Directions that rounding hides, because submodels imitate each other, are
/// as uncertain as rounding allows; in them, the response hardly changes.
Eigen::MatrixXd root_of_inverse(Eigen::MatrixXd N, const std::vector<Eigen::Index>& frozen) {
  hold_unknowns(frozen, N);
  const Eigen::VectorXd scale =
      N.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt().cwiseInverse();
  const auto eigen = symmetric_eigen(scale.asDiagonal() * N * scale.asDiagonal());
  const Eigen::VectorXd& values = eigen.eigenvalues();  // rising
  const double least = static_cast<double>(values.size()) * std::numeric_limits<double>::epsilon() *
                       values.tail(1).value();
  Eigen::MatrixXd root = scale.asDiagonal() * eigen.eigenvectors() *
                         values.cwiseMax(least).cwiseSqrt().cwiseInverse().asDiagonal();
  root(frozen, Eigen::all).setZero();
  return root;
}

/// Square roots of the sandwich and of N^-1, both scaled as covariances: C = R R^T. A variance from R is never negative.
struct Roots {
  Eigen::MatrixXd sandwich;
  Eigen::MatrixXd bread;
};

Roots roots_of_covariance(const FitProblem& problem, const FitParameters& beta,
                          const std::vector<BasisGroup>& groups, double cost,
                          const ResidueFactors& factors, const DataNoise& noise,
                          const std::vector<Eigen::Index>& frozen) {
  const auto reduced = [&](const FitProblem& one) {
    return factors.reduced_matrix(
        beta, ArrowSystem(one, beta, groups, FitMethod::gn, ChannelEquationsUse::only_kept));
  };
  const double half = 0.5 * covariance_scale(problem, cost, factors.size(), noise.knowledge);
  const Eigen::MatrixXd bread = std::sqrt(half) * root_of_inverse(reduced(problem), frozen);
  if (!noise.correlation.known() && !noise.variance) return {bread, bread};
  const Eigen::MatrixXd K = noise.correlation.known()
                                ? correlated_middle(problem, beta, groups, factors, noise)
                                : reduced(middle_problem(problem, noise));
  const Eigen::MatrixXd middle = bread.transpose() * K * bread / half;
  return {bread * Eigen::MatrixXd(middle.llt().matrixL()), bread};
}

}  // namespace

FitCovariance low_rank_parameters(const FitProblem& problem, const FitParameters& beta,
                                  const std::vector<BasisGroup>& groups, double cost,
                                  const ResidueFactors& factors, const DataNoise& noise,
                                  const std::vector<Eigen::Index>& frozen) {
  const Roots roots = roots_of_covariance(problem, beta, groups, cost, factors, noise, frozen);
  if (!roots.sandwich.allFinite()) return {};
  return {roots.sandwich * roots.sandwich.transpose(), roots.bread * roots.bread.transpose()};
}

ParameterCovariance low_rank_covariance(const FitProblem& problem, const FitParameters& beta,
                                        double cost, const ResidueFactors& factors,
                                        const DataNoise& noise,
                                        const std::vector<Eigen::Index>& frozen,
                                        bool with_response) {
  const std::vector<BasisGroup> groups = evaluate_groups(problem, beta, true);
  const Eigen::MatrixXd root =
      roots_of_covariance(problem, beta, groups, cost, factors, noise, frozen).sandwich;
  if (!root.allFinite()) return {};
  const Eigen::MatrixXd C = root * root.transpose();
  ParameterCovariance out;
  out.residual_scale = covariance_scale(problem, cost, factors.size(), noise.knowledge);
  out.globals = C.topLeftCorner(problem.globals(), problem.globals());
  out.numerator_variance.resize(problem.channels(), problem.functions());
  if (with_response) out.response_variance.resize(problem.channels(), problem.size());
  for (const BasisGroup& group : groups)
    for_each_task(problem.threads, static_cast<int>(group.channels.size()), [&](int r) {
      const Eigen::Index c = group.channels[r];
      const std::vector<Eigen::Index> own = parameters_of(problem, beta, factors, c, 1);
      out.numerator_variance.row(c) = numerator_variances(problem, beta, factors, c, C).transpose();
      if (!with_response) return;
      const SplitMatrix J =
          free_columns(problem, beta, factors, group, c, own, {0, problem.size()});
      const Eigen::MatrixXd own_root = root(own, Eigen::all);
      out.response_variance.row(c) =
          ((J.re * own_root).rowwise().squaredNorm() + (J.im * own_root).rowwise().squaredNorm())
              .transpose();
    });
  return out;
}

}  // namespace stageid
