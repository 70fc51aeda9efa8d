#include "estimation/pole_bounds.hpp"

#include <algorithm>
#include <cmath>

namespace stageid {
namespace {

constexpr double kSmallestDamping = 1e-5;
constexpr double kLargestDamping = 0.9;
constexpr double kLargestMove = 4.0 / 3.0;  // of a natural frequency in one iteration
constexpr double kBelowLines = 0.25;        // lower, it could not be told from the rigid body
constexpr double kAboveLines = 10.0;
constexpr double kNearlyNyquist = 3.1;  // rad a sample
constexpr double kAtBound = 1.0 + 1e-9;

}  // namespace

PoleBounds::PoleBounds(const FitProblem& problem, const FitParameters& start) {
  lowest_rad_s_ = kBelowLines * problem.lines.omega_rad_s.minCoeff();
  const double highest_line = problem.lines.omega_rad_s.maxCoeff();
  highest_rad_s_ = problem.lines.hold == HoldModel::exact
                       ? std::max(kNearlyNyquist / problem.lines.sample_period_s, highest_line)
                       : kAboveLines * highest_line;
  for (const Eigen::VectorXd& a : start.a)
    if (a.size() == 2 && a[1] > 0.0) lowest_rad_s_ = std::min(lowest_rad_s_, 1.0 / std::sqrt(a[1]));
}

bool PoleBounds::stabilize_mode(const Eigen::VectorXd& before, Eigen::VectorXd& a) const {
  if (!(a[1] > 0.0)) return false;
  const double move = std::sqrt(before[1] / a[1]);
  // Held at the bound, not refused: a mode that leans on it must not stop all the others.
  a[1] = std::clamp(a[1], 1.0 / (highest_rad_s_ * highest_rad_s_),
                    1.0 / (lowest_rad_s_ * lowest_rad_s_));
  const double root = std::sqrt(a[1]);
  // An unstable start is reflected; a step towards instability ends at the bound, where the mode is
  // then held: reflected, it would bounce.
  const double damping = before[0] > 0.0 ? std::max(a[0], 0.0) : std::abs(a[0]);
  a[0] = 2.0 * root * std::clamp(damping / (2.0 * root), kSmallestDamping, kLargestDamping);
  return (move < kLargestMove && move > 1.0 / kLargestMove) || before[1] == a[1];
}

bool PoleBounds::stabilize(const FitParameters& before, FitParameters& beta) const {
  for (std::size_t i = 0; i < beta.a.size(); ++i) {
    Eigen::VectorXd& a = beta.a[i];
    if (a.size() == 1) {
      if (!(a[0] > 0.0)) return false;
    } else if (a.size() == 2) {
      if (!stabilize_mode(before.a[i], a)) return false;
    } else {
      for (const std::complex<double> pole : roots(a))
        if (!(pole.real() < 0.0)) return false;
    }
  }
  return true;
}

std::vector<Eigen::Index> PoleBounds::leaning(const FitParameters& beta,
                                              const Eigen::VectorXd& descent) const {
  std::vector<Eigen::Index> out;
  Eigen::Index p = 0;
  for (const Eigen::VectorXd& a : beta.a) {
    if (a.size() == 2) {
      const double omega = 1.0 / std::sqrt(a[1]);
      const bool below = omega < lowest_rad_s_ * kAtBound && descent[p + 1] > 0.0;
      const bool above = omega * kAtBound > highest_rad_s_ && descent[p + 1] < 0.0;
      const double zeta = 0.5 * a[0] * omega;
      const bool overdamped = zeta * kAtBound > kLargestDamping && descent[p] > 0.0;
      const bool undamped = zeta < kSmallestDamping * kAtBound && descent[p] < 0.0;
      if (below || above || overdamped || undamped) out.push_back(p);
      if (below || above) out.push_back(p + 1);
    }
    p += a.size();
  }
  return out;
}

}  // namespace stageid
