#include "estimation/fit/hidden_modes.hpp"

#include <algorithm>

#include "estimation/equations/numerators.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/model/model_structure.hpp"
#include "frf/response/neighbour_scatter.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {

namespace {

/// Variance of a real number of the residual in units of its weight: of all the residual where there are too few lines
/// for a scatter, which does not contain what the model misses.
double noise_of(const FrfEstimate& frf, const Eigen::MatrixXd& weights, const FitResult& fit,
                int threads) {
  const double all = fit.model.fit.cost / static_cast<double>(frf.response.rows());
  if (!has_line_scatter(frf.lines())) return all;
  const auto of_tile = [&](DataRange tile) {
    const auto [first, count] = tile;
    const Eigen::MatrixXcd E = frf.response.middleRows(first, count) -
                               response(fit.model, frf.frequency_hz, fit.model.hold, first, count);
    const Eigen::MatrixXd W = weights.middleRows(first, count);
    return W.cwiseProduct(scatter_variance(frf.frequency_hz, E, threads)).sum();
  };
  const double scatter =
      number_over_tiles(*frf.team, weights.rows(), of_tile) / static_cast<double>(weights.size());
  return std::min(all, 0.5 * scatter);
}

}  // namespace

int hold_hidden_modes(const FrfEstimate& frf, const Eigen::MatrixXd& weights, int threads,
                      FitResult& fit) {
  const double noise = noise_of(frf, weights, fit, threads);
  const Eigen::Index channels = frf.response.rows();
  int hidden = 0;
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i) {
    Submodel& s = fit.model.submodels[i];
    if (!is_searched_mode(s)) continue;
    const auto numbers =
        static_cast<double>(s.numerator.size() * static_cast<std::size_t>(channels));
    const double by_noise = tail_of_chi_square(fit.removal_cost[i] / noise, numbers);
    const bool is_hidden = by_noise * static_cast<double>(frf.lines()) >= 1.0;
    s.held = is_hidden ? HeldPole::pole : HeldPole::none;
    if (is_hidden) ++hidden;
  }
  return hidden;
}

void shrink_hidden_modes(const FitProblem& problem, const BasisGroups& groups,
                         const std::vector<std::size_t>& hidden, const std::vector<double>& removal,
                         Eigen::MatrixXd& B, double& cost) {
  const auto channels = static_cast<double>(problem.channels());
  // Of a real number: half of the variance of a complex one.
  const double noise = 0.5 * residual_per_degree(problem, cost, problem.parameters());
  std::vector<double> share(problem.shapes.size(), 0.0);
  for (const std::size_t i : hidden) {
    const double numbers = channels * static_cast<double>(problem.shapes[i].functions());
    if (numbers > 2.0)
      share[i] = std::min(kLargestShare, kPartOfShare * (numbers - 2.0) * noise / removal[i]);
  }
  cost +=
      shrink_numerators(problem, groups, share, B) / (2.0 * static_cast<double>(problem.size()));
}

}  // namespace stageid
