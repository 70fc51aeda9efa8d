#include "estimation/iteration/descent.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/problem/search_limit.hpp"

namespace stageid {
namespace {

/// If no step lowers the cost, it is at rounding level if the stationary point is at most this many standard deviations
/// away.
constexpr double kRoundingDeviations = 0.05;
// A trial whose iteration predicts less than this part of what it must gain is given up. On 25 plants of unknown
// structure, 65 of 73 successful trials stay above it; 24 plants end at the same cost as without it, one at a lower one.
constexpr double kWorthwhilePart = 1.0 / 3.0;

}  // namespace

IterationResult Descent::run() {
  if (begin()) {
    result_.cost.push_back(cost_);
    while (go_on() || passes_jump()) {
    }
  }
  conclude();
  result_.end_cost = cost_;
  bounds_.drop_delays(result_.frozen);
  return std::move(result_);
}

bool Descent::go_on() {
  if (has_unknowns_) {
    if (options_.limit && options_.limit->reached())
      return end(options_.limit->status(), options_.limit->message());
    if (result_.iterations >= options_.max_iterations)
      return end_here(FitStatus::iteration_limit,
                      fmt::format("stopped after {} iterations", result_.iterations));
  }
  return improve();
}

void Descent::accept(double lower) {
  cost_ = lower;
  result_.cost.push_back(lower);
  ++result_.iterations;
  if (options_.progress) options_.progress(result_.iterations, lower);
}

bool Descent::end(FitStatus why, std::string reason) {
  result_.status = why;
  result_.message = std::move(reason);
  return false;
}

bool Descent::end_here(FitStatus why, const std::string& what) {
  return end(why, fmt::format("{}, {:.1g} standard deviations from the first-order condition; "
                              "scaled gradient {:.2g}",
                              what, result_.deviations, result_.gradient));
}

bool Descent::end_without_step() {
  if (at_rounding())
    return end(FitStatus::step_small,
               "converged: the residual is at rounding level and no step lowers the cost");
  return result_.deviations < kRoundingDeviations
             ? end_here(FitStatus::step_small, "converged: the cost is at rounding level")
             : end_here(FitStatus::cost_stalled, "no step lowers the cost");
}

bool Descent::may_continue(double gradient, double decrement) {
  result_.gradient = gradient;
  // The distance to the stationary point in standard deviations of the noise estimated from the residual.
  const double data = static_cast<double>(problem_.size() * problem_.channels());
  result_.deviations = std::sqrt(decrement * data / squares());
  if (gradient < options_.gradient_tolerance || result_.deviations < options_.deviation_tolerance)
    return end_here(FitStatus::gradient_small, "converged");
  if (cost_ < 1e-28 * signal_cost_)
    return end(FitStatus::gradient_small, "converged: the residual is at rounding level");
  if (cost_ * decrement / squares() < kWorthwhilePart * (cost_ - options_.worthwhile_cost))
    return end(FitStatus::iteration_limit, "given up: the cost does not fall far enough");
  return true;
}

double scaled_gradient(const Eigen::MatrixXd& M, const Eigen::VectorXd& e,
                       const std::vector<Eigen::Index>& frozen, double squares) {
  double largest = 0.0;
  for (Eigen::Index i = 0; i < e.size(); ++i)
    if (std::ranges::find(frozen, i) == frozen.end())
      largest = std::max(largest,
                         std::abs(e[i]) / std::sqrt(std::max(std::abs(M(i, i)) * squares, 1e-300)));
  return largest;
}

}  // namespace stageid
