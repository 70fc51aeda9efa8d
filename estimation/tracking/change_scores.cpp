#include "estimation/tracking/change_scores.hpp"

#include <cmath>
#include <utility>

namespace stageid {

ChangeScores::ChangeScores(std::vector<PossibleChange> possible, const TrackingReference& reference)
    : possible_(std::move(possible)), reference_(reference) {}

Eigen::VectorXd ChangeScores::of(const Eigen::VectorXd& gradient,
                                 const Eigen::VectorXd& noise_power) const {
  Eigen::VectorXd scores = Eigen::VectorXd::Zero(std::ssize(possible_));
  for (Eigen::Index h = 0; h < scores.size(); ++h) {
    const PossibleChange& change = possible_[h];
    const Eigen::VectorXd& d = change.direction;
    if (change.kind != ChangeKind::noise)
      scores[h] = d.dot(gradient) / std::sqrt(d.dot(reference_.covariance() * d));
    else if (noise_power.size() > 0)
      scores[h] = (noise_power[change.index] - 1.0) / reference_.noise_deviation()[change.index];
  }
  return scores;
}

Eigen::MatrixXd ChangeScores::correlation() const {
  const auto H = std::ssize(possible_);
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(H, H);
  for (Eigen::Index g = 0; g < H; ++g)
    for (Eigen::Index h = 0; h < H; ++h) {
      const Eigen::VectorXd& a = possible_[g].direction;
      const Eigen::VectorXd& b = possible_[h].direction;
      if (a.size() == 0 || b.size() == 0) continue;
      const Eigen::VectorXd Kb = reference_.covariance() * b;
      correlation(g, h) = a.dot(Kb) / std::sqrt(a.dot(reference_.covariance() * a) * b.dot(Kb));
    }
  return correlation;
}

Eigen::VectorXd ChangeScores::freedom() const {
  Eigen::VectorXd freedom(std::ssize(possible_));
  for (Eigen::Index h = 0; h < freedom.size(); ++h) {
    const Eigen::VectorXd& d = possible_[h].direction;
    freedom[h] = d.size() > 0 ? (d.array() != 0.0).select(reference_.freedom(), HUGE_VAL).minCoeff()
                              : reference_.periods() - 1.0;
  }
  return freedom;
}

}  // namespace stageid
