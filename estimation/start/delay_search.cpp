#include "estimation/start/delay_search.hpp"

#include <limits>
#include <vector>

#include "estimation/equations/numerators.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kChannelsOfSearch = 512;  // enough to determine one delay

/// The problem, or a subset of evenly spaced channels as outputs of one input. The subset has its own copies of data
/// and weights, to save memory.
FitProblem some_channels(const FitProblem& problem) {
  FitProblem out = problem;
  const Eigen::Index step = (problem.channels() + kChannelsOfSearch - 1) / kChannelsOfSearch;
  if (step <= 1) return out;
  const Eigen::Index count = (problem.channels() + step - 1) / step;
  std::vector<Eigen::Index> chosen(count);
  for (Eigen::Index i = 0; i < count; ++i) chosen[i] = i * step;
  out.n_outputs = count;
  out.n_inputs = 1;
  out.G = chosen_channels(*problem.team, *problem.G, chosen, Eigen::all);
  if (problem.W->size() > 0) out.W = chosen_channels(*problem.team, *problem.W, chosen, Eigen::all);
  return out;
}

}  // namespace

void search_delay(const FitProblem& problem, FitParameters& beta) {
  // The poles are not right yet. With weights from the noise, one sharp mode that is off by a part of its width would
  // outweigh the phase of everything else. With relative errors it does not.
  FitProblem relative = some_channels(problem);
  const auto power = relative.G->array().abs2();
  const Eigen::ArrayXd floor = 1e-6 * power.rowwise().mean() + 1e-300;
  Eigen::MatrixXd weights = (power > 0.0).select((power.colwise() + floor).inverse(), 0.0).matrix();
  if (relative.W->size() > 0) weights.array() *= (relative.W->array() > 0.0).cast<double>();
  relative.W = std::move(weights);
  const double highest = problem.lines.omega_rad_s.maxCoeff();
  const double step =
      0.5 / highest;  // rad at the highest line: well inside the basin of the best delay
  double best_cost = std::numeric_limits<double>::infinity();
  Eigen::VectorXd best = beta.input_delay_s;
  FitParameters trial = beta;
  trial.input_delay_s.setZero(relative.n_inputs);
  trial.output_delay_s.setZero(relative.n_outputs);
  for (int i = 0; i <= 24; ++i) {
    trial.input_delay_s.setConstant(step * i);
    const auto solved = solve_numerators(relative, BasisGroups(relative, trial, false), trial.B);
    if (!solved || !(solved->cost < best_cost)) continue;
    best_cost = solved->cost;
    best.setConstant(step * i);
  }
  beta.input_delay_s = best;
}

}  // namespace stageid
