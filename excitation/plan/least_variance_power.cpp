#include "excitation/plan/least_variance_power.hpp"

#include <algorithm>
#include <limits>

#include "excitation/words/require.hpp"

namespace stageid {
namespace {

constexpr int kMostRounds = 3000;
constexpr double kGap = 1e-6;
// A multiplier of zero could not grow again if its bound became active later.
constexpr double kSmallestMultiplier = 1e-14;
// Entries without cost must be excited too: they count with this share of the largest cost.
constexpr double kSmallestCost = 1e-12;

void check(const Eigen::Ref<const Eigen::VectorXd>& cost,
           const Eigen::Ref<const Eigen::MatrixXd>& bounds) {
  require(cost.size() == bounds.cols() && cost.size() > 0 && bounds.rows() > 0,
          "excitation power: {} costs and {} x {} bounds; the bounds must have one column per cost",
          cost.size(), bounds.rows(), bounds.cols());
  require(cost.allFinite() && cost.minCoeff() >= 0.0 && cost.maxCoeff() > 0.0,
          "excitation power: the costs must be finite and nonnegative, and at least one must be "
          "positive");
  require(bounds.allFinite() && bounds.minCoeff() >= 0.0,
          "excitation power: the bounds must be finite and nonnegative");
  for (Eigen::Index i = 0; i < cost.size(); ++i)
    require(bounds.col(i).maxCoeff() > 0.0, "excitation power: entry {} is unbounded", i);
}

}  // namespace

PowerSpectrum least_variance_power(const Eigen::Ref<const Eigen::VectorXd>& cost,
                                   const Eigen::Ref<const Eigen::MatrixXd>& bounds) {
  check(cost, bounds);
  const Eigen::ArrayXd c = cost.array().max(kSmallestCost * cost.maxCoeff());
  Eigen::VectorXd lambda = Eigen::VectorXd::Ones(bounds.rows());
  PowerSpectrum best;
  best.cost = std::numeric_limits<double>::infinity();
  for (int round = 0; round < kMostRounds; ++round) {
    const Eigen::ArrayXd price = (bounds.transpose() * lambda).array();
    const Eigen::ArrayXd power = (c / price).sqrt();
    const Eigen::VectorXd use = bounds * power.matrix();
    const double scale = 1.0 / use.maxCoeff();
    const double total = (c / power).sum() / scale;
    if (total < best.cost) {
      best.cost = total;
      best.power = scale * power;
    }
    // max over s > 0 of  2 sqrt(s) S - s L,  S = sum sqrt(c price), L = sum lambda.
    const double root_sum = (c * price).sqrt().sum();
    const double bound = root_sum * root_sum / lambda.sum();
    best.lower_bound = std::max(best.lower_bound, bound);
    if (best.cost <= (1.0 + kGap) * best.lower_bound) break;
    // B a = 1 at the optimum. a has degree -1/2 in lambda, so the scale converges without a step size.
    lambda.array() *= use.array() / use.maxCoeff();
    lambda = lambda.cwiseMax(kSmallestMultiplier * lambda.maxCoeff());
    lambda /= lambda.maxCoeff();
  }
  return best;
}

}  // namespace stageid
