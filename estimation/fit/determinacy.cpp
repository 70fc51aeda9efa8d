#include "estimation/fit/determinacy.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "estimation/fit/mode_worth.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/iteration/fit_iteration.hpp"
#include "estimation/model/poles.hpp"
#include "estimation/uncertainty/parameter_covariance.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

/// @param first coefficient of submodel `i` among the globals
bool is_judged(const FitProblem& problem, std::size_t i, Eigen::Index first, bool judge_modes) {
  const int order = problem.shapes[i].order;
  const SubmodelRole role = problem.roles.empty() ? SubmodelRole::searched : problem.roles[i];
  if (order == 0 || role == SubmodelRole::suspension) return false;
  if (judge_modes && !problem.is_held(first)) return true;
  return order != 2 || problem.shapes[i].integrators > 0 || role == SubmodelRole::given;
}

/// 1 - R^2 of every free global: the part of its effect that no other parameter can imitate.
Eigen::VectorXd own_shares(const ArrowSystem& gn, const std::vector<Eigen::Index>& frozen) {
  const Eigen::MatrixXd inverse = free_inverse(gn.schur(), frozen);
  return (gn.M_globals().diagonal().cwiseProduct(inverse.diagonal())).cwiseInverse();
}

/// Why the standard deviations contradict the poles of submodel `i`, whose first coefficient is `first`; else empty.
std::string too_uncertain(const FitProblem& problem, const FitParameters& beta,
                          const Eigen::MatrixXd& covariance, std::size_t i, Eigen::Index first) {
  const Eigen::Index n = problem.shapes[i].order;
  for (const PoleEstimate& pole : pole_estimates(beta.a[i], covariance.block(first, first, n, n))) {
    const double f = pole.natural_frequency_hz;
    const double std_hz = pole.natural_frequency_std_hz.value_or(0.0);
    if (!(std_hz < f))
      return fmt::format("its pole at {:.4g} Hz has a standard deviation of {:.2g} Hz", f, std_hz);
    const double damping_std = pole.damping_ratio_std.value_or(0.0);
    if (!(damping_std < pole.damping_ratio))
      return fmt::format(
          "the damping ratio {:.2g} of its pole at {:.4g} Hz has a standard deviation of {:.2g}",
          pole.damping_ratio, f, damping_std);
  }
  return {};
}

/// Why the part of submodel `i` that the others cannot replace is too small; else empty. Noise alone would let a
/// submodel lower sum W |E|^2 by half of its variance per parameter, and by more if its frequency is searched.
std::string too_small(const FitProblem& problem, double cost, double removal_cost, std::size_t i) {
  const double power = 2.0 * static_cast<double>(problem.size()) * signal_cost(problem);
  if (removal_cost < kRoundingPower * power) return "its response is at rounding level";
  const SubmodelShape& shape = problem.shapes[i];
  const Eigen::Index parameters = problem.channels() * shape.functions() + shape.order;
  const double noise = residual_per_degree(problem, cost, problem.parameters());
  if (removal_cost < noise * static_cast<double>(parameters))
    return "its response is within the noise";
  return {};
}

/// For messages: "submodel 2 (l=0, n=4, m=3, poles at 120.4, 181 Hz)", counted from 1.
std::string submodel_name(const FitProblem& problem, const FitParameters& beta, std::size_t i) {
  const SubmodelShape& shape = problem.shapes[i];
  std::string text = fmt::format("submodel {} (l={}, n={}, m={}", i + 1, shape.integrators,
                                 shape.order, shape.numerator_degree);
  std::vector<std::string> poles;
  for (const PoleEstimate& pole : pole_estimates(beta.a[i], Eigen::MatrixXd()))
    poles.push_back(fmt::format("{:.4g}", pole.natural_frequency_hz));
  if (!poles.empty())
    text += fmt::format(", pole{} at {} Hz", poles.size() > 1 ? "s" : "", fmt::join(poles, ", "));
  return text + ")";
}

}  // namespace

std::string undetermined_numerators(const FitProblem& problem, const FitParameters& beta,
                                    const std::vector<BasisGroup>& groups) {
  // Of every tile: the smallest ratio of eigenvalues, and its direction.
  const Eigen::Index tiles = channel_tiles(problem.channels());
  Eigen::MatrixXd found =
      Eigen::MatrixXd::Constant(tiles, 1 + problem.functions(), kSmallestDirection);
  for_each_own_tile(*problem.team, problem.channels(), [&](DataRange tile) {
    auto weakest = found.row(tile.first / kTileChannels);
    for (const BasisGroup& group : groups)
      for (auto at = std::ranges::lower_bound(group.channels, tile.first);
           at != group.channels.end() && *at < tile.first + tile.count; ++at) {
        const Eigen::Index c = *at;
        const Eigen::VectorXd w = problem.weights(c);
        const Eigen::MatrixXd M = group.F.re.transpose() * w.asDiagonal() * group.F.re +
                                  group.F.im.transpose() * w.asDiagonal() * group.F.im;
        const Eigen::VectorXd scale = M.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
        const auto eigen = symmetric_eigen(scale.asDiagonal() * M * scale.asDiagonal());
        const Eigen::VectorXd& values = eigen.eigenvalues();
        if (!(values[0] < weakest[0] * values[values.size() - 1])) continue;
        weakest << values[0] / values[values.size() - 1], eigen.eigenvectors().col(0).transpose();
      }
  });
  problem.team->gather_rows(1, found);
  Eigen::Index at = 0;
  if (!(found.col(0).minCoeff(&at) < kSmallestDirection)) return {};
  const Eigen::VectorXd direction = found.row(at).tail(problem.functions()).transpose();
  std::vector<std::string> names;
  Eigen::Index first = 0;
  for (std::size_t i = 0; i < problem.shapes.size(); ++i) {
    const Eigen::Index functions = problem.shapes[i].functions();
    if (direction.segment(first, functions).norm() > kSmallPart)
      names.push_back(submodel_name(problem, beta, i));
    first += functions;
  }
  return fmt::format("the data do not support the numerators of {}", fmt::join(names, " and "));
}

std::string undetermined_poles(const FitProblem& problem, const FitParameters& beta,
                               const ArrowSystem& gn, const Eigen::MatrixXd& covariance,
                               bool judge_modes, const FitResult& fit) {
  if (problem.globals() == 0) return {};
  const Eigen::VectorXd shares = own_shares(gn, fit.frozen);
  Eigen::Index first = 0;
  for (std::size_t i = 0; i < problem.shapes.size(); ++i) {
    const Eigen::Index n = problem.shapes[i].order;
    if (is_judged(problem, i, first, judge_modes)) {
      std::string reason;
      if (fit.is_held(i))
        reason = "a pole is at a bound, where the lines contain no information on it";
      else if (!(shares.segment(first, n).minCoeff() > kSmallestShare))
        reason = "the rest of the model can compensate for a change of its denominator";
      else
        reason = too_small(problem, fit.model.fit.cost, fit.removal_cost[i], i);
      if (reason.empty() && covariance.size() > 0)
        reason = too_uncertain(problem, beta, covariance, i, first);
      if (!reason.empty())
        return fmt::format("the data do not support {}: {}", submodel_name(problem, beta, i),
                           reason);
    }
    first += n;
  }
  return {};
}

}  // namespace stageid
