#include "estimation/tracking/change_naming.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

namespace stageid {
namespace {

/// The size of a change that explains most, and the chi-square that it explains.
struct Explanation {
  double explained = 0.0;
  double size = 0.0;
};

class ChangeNaming {
 public:
  ChangeNaming(const TrackedResponse& response, const TrackingReference& reference,
               const ChangeScores& scores, const std::deque<PeriodSpectra>& recent)
      : response_(response), reference_(reference), scores_(scores), recent_(recent) {}

  StageChange name(int since, const Eigen::VectorXd& mean_scores,
                   const Eigen::VectorXd& mean_scores_of_differences) const {
    std::vector<StageChange> changes = changes_of_response(since, mean_scores);
    const auto likeliest =
        std::ranges::max_element(changes, std::less<>(), &StageChange::statistic);
    const Eigen::MatrixXcd there =
        likeliest == changes.end()
            ? reference_.response()
            : response_.at(reference_.x() + likeliest->size * likeliest->what.direction);
    for (StageChange& change : changes_of_noise(since, mean_scores_of_differences, there))
      changes.push_back(std::move(change));
    if (reference_.motion_freedom() > 0.0) changes.push_back(change_of_motion(since, there));
    std::ranges::sort(changes, std::greater<>(), &StageChange::statistic);
    double sum = 0.0;
    for (const StageChange& change : changes)
      sum += std::exp(0.5 * (change.statistic - changes.front().statistic));
    StageChange& named = changes.front();
    named.probability = 1.0 / sum;
    if (changes.size() > 1) {
      named.otherwise = changes[1].what;
      named.other_probability = std::exp(0.5 * (changes[1].statistic - named.statistic)) / sum;
    }
    // Chance alone reaches this in 5 % of the disturbances.
    if (named.statistic < 2.0 * std::log(static_cast<double>(changes.size()) / 0.05))
      named.what = {ChangeKind::disturbance, 0, {}};
    return named;
  }

 private:
  /// Of as many periods, each compared with the mean of the learned ones.
  double independent(int count) const { return count / (1.0 + count / reference_.periods()); }

  /// Of a chi-square, by weights from few periods. The same for all changes, so that it does not choose between them.
  double inflation() const {
    std::vector<double> ratios;
    for (const PossibleChange& change : scores_.possible())
      if (const Eigen::VectorXd& d = change.direction; d.size() > 0)
        ratios.push_back(d.dot(reference_.covariance() * d) / d.dot(reference_.information() * d));
    std::ranges::sort(ratios);
    return ratios.empty() ? 1.0 : ratios[ratios.size() / 2];
  }

  /// Least damping ratio of the modes whose frequency moves; infinite if none does.
  double narrowest(const PossibleChange& change) const {
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index p = 0; p < response_.size(); ++p) {
      const TrackedParameter& of = response_.parameters()[p];
      if (of.kind != TrackedKind::frequency || change.direction[p] == 0.0) continue;
      const Submodel& mode = response_.model().submodels[of.index];
      least = std::min(least, mode.damping_ratio());
    }
    return least;
  }

  /// A change as large as it is, from the mean of the last periods: the response is not linear in modes and delay, and a
  /// large change of the stage also changes the inputs.
  Explanation explain(const PossibleChange& change, const PeriodSpectra& mean,
                      double linear_size) const {
    const TrackedParameter& of = response_.parameters()[change.index];
    const bool one_mode = change.kind == ChangeKind::parameter &&
                          (of.kind == TrackedKind::frequency || of.kind == TrackedKind::damping);
    const auto predicted = [&](double size) {
      const Eigen::VectorXd there = reference_.x() + size * change.direction;
      return one_mode ? response_.at(there, of.index) : response_.at(there);
    };
    const Eigen::MatrixXcd before = predicted(0.0);
    const Eigen::VectorXd observed = reference_.whitened_change(mean);
    const auto left = [&](double size) -> Eigen::VectorXd {
      return observed -
             reference_.whitened_change(TrackedResponse::outputs(predicted(size) - before, mean.U));
    };
    Explanation best{0.0, linear_size};
    double least = left(linear_size).squaredNorm();
    const auto try_size = [&](double size) {
      const double square = left(size).squaredNorm();
      if (square >= least) return;
      least = square;
      best.size = size;
    };
    // From the best of some sizes: with a large change, a resonance has left its place. Resonances are narrow.
    const double largest = largest_changes(response_.parameters(), response_.model().sample_rate_hz)
                               .cwiseProduct(change.direction)
                               .maxCoeff();
    if (!is_of_gains(change, response_.parameters()))
      for (double size = largest; size > 1e-3 * largest; size *= 0.5)
        for (const double candidate : {size, -size}) try_size(candidate);
    const double step = std::max(narrowest(change), 0.01 * largest);
    for (double size = step; size <= largest; size += step)
      for (const double candidate : {size, -size}) try_size(candidate);
    for (int iteration = 0; iteration < 10; ++iteration) {
      const double difference = 1e-4 * std::abs(best.size) + 1e-12 * largest;
      const Eigen::VectorXd now = left(best.size);
      const Eigen::VectorXd slope = (left(best.size + difference) - now) / difference;
      const double size = best.size - slope.dot(now) / slope.squaredNorm();
      const double square = left(size).squaredNorm();
      if (!(square < least)) break;
      best.size = size;
      least = square;
    }
    best.explained = observed.squaredNorm() - least;
    return best;
  }

  std::vector<StageChange> changes_of_response(int since,
                                               const Eigen::VectorXd& mean_scores) const {
    const PeriodSpectra mean =
        mean_of(recent_, std::min(recent_.size(), static_cast<std::size_t>(since)));
    const double of_chi_square = independent(since) / inflation();
    std::vector<StageChange> changes;
    for (std::size_t h = 0; h < scores_.possible().size(); ++h) {
      StageChange change;
      change.what = scores_.possible()[h];
      if (change.what.kind == ChangeKind::noise) continue;
      change.periods = since;
      const Eigen::VectorXd& d = change.what.direction;
      const double information = d.dot(reference_.information() * d);
      const double deviation = std::sqrt(d.dot(reference_.covariance() * d)) / information;
      change.size = mean_scores[h] * deviation;
      change.deviation = deviation / std::sqrt(independent(since));
      double explained = change.size * change.size * information;
      if (keeps(since)) {
        const Explanation exact = explain(change.what, mean, change.size);
        change.size = exact.size;
        explained = exact.explained;
      }
      change.statistic = explained * of_chi_square;
      changes.push_back(change);
    }
    return changes;
  }

  /// A change of the rms, from a mean square that is `ratio` times the learned one.
  /// @param freedom degrees of freedom of that mean square: without change, its variance is 2 / freedom
  StageChange change_of_scatter(const PossibleChange& what, int since, double ratio,
                                double freedom) const {
    ratio = std::max(1e-6, ratio);  // of a signal that does not change at all
    StageChange change;
    change.what = what;
    change.periods = since;
    change.size = std::sqrt(ratio) - 1.0;
    // The scatter of a power is proportional to it.
    change.deviation = (1.0 + change.size) / std::sqrt(2.0 * freedom);
    change.statistic = freedom * (ratio - 1.0 - std::log(ratio));
    return change;
  }

  /// @param P of the most probable other change: in a wrong response, the noise in U raises that of the residual
  std::vector<StageChange> changes_of_noise(int since, const Eigen::VectorXd& mean_scores,
                                            const Eigen::MatrixXcd& P) const {
    const int differences = since - 1;
    Eigen::VectorXd power = Eigen::VectorXd::Zero(reference_.noise_deviation().size());
    if (keeps(since)) {
      std::optional<Eigen::MatrixXcd> last;
      for (auto period = recent_.end() - since; period != recent_.end(); ++period) {
        Eigen::MatrixXcd now = reference_.residual(*period, P);
        if (last) power += reference_.noise_power(now - *last) / differences;
        last = std::move(now);
      }
    }
    std::vector<StageChange> changes;
    for (std::size_t h = 0; h < scores_.possible().size(); ++h) {
      const PossibleChange& what = scores_.possible()[h];
      if (what.kind != ChangeKind::noise) continue;
      const double deviation = reference_.noise_deviation()[what.index];
      const double ratio = keeps(since) ? power[what.index] : 1.0 + deviation * mean_scores[h];
      changes.push_back(change_of_scatter(
          what, since, ratio, 2.0 * independent(differences) / (deviation * deviation)));
    }
    return changes;
  }

  /// @param P of the most probable other change: what it explains is no motion
  StageChange change_of_motion(int since, const Eigen::MatrixXcd& P) const {
    const auto kept = std::min(since, static_cast<int>(recent_.size()));
    double power = 0.0;
    for (auto period = recent_.end() - kept; period != recent_.end(); ++period)
      power += reference_.motion_power(*period, P) / kept;
    return change_of_scatter({ChangeKind::motion, 0, {}}, since, power,
                             reference_.motion_freedom() * independent(since));
  }

  bool keeps(int since) const { return since <= std::ssize(recent_); }

  const TrackedResponse& response_;
  const TrackingReference& reference_;
  const ChangeScores& scores_;
  const std::deque<PeriodSpectra>& recent_;
};

}  // namespace

StageChange name_change(const TrackedResponse& response, const TrackingReference& reference,
                        const ChangeScores& scores, const std::deque<PeriodSpectra>& recent,
                        int since, const Eigen::VectorXd& mean_scores,
                        const Eigen::VectorXd& mean_scores_of_differences) {
  return ChangeNaming(response, reference, scores, recent)
      .name(since, mean_scores, mean_scores_of_differences);
}

}  // namespace stageid
