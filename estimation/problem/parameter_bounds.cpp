#include "estimation/problem/parameter_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimation/model/hold_integral.hpp"
#include "estimation/model/poles.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

constexpr double kSmallestDamping = 1e-5;
constexpr double kLargestDamping = 0.9;
constexpr double kLargestMove = 4.0 / 3.0;  // of a natural frequency in one iteration
constexpr double kBelowLines = 0.25;        // lower: resembles the rigid body
// A pole at 1/300 of the lowest line changes 1/s^2 by 1e-5 there, less than any measurement resolves.
constexpr double kFarBelowLines = 1.0 / 300.0;
constexpr double kAboveLines = 10.0;
constexpr double kNearlyNyquist = 3.1;  // rad per sample
constexpr double kBesideJump = 1e-9;    // samples
constexpr double kAtBound = 1.0 + 1e-9;
constexpr double kPoleAtBound = 1.0 + 1e-6;  // after conversion to coefficients and back

/// The slowest pole of a start's denominator.
double slowest(const Eigen::VectorXd& a) {
  double least = std::numeric_limits<double>::infinity();
  for (const Complex pole : roots(a)) least = std::min(least, std::abs(pole));
  return least;
}

double delay_in_samples(const FitProblem& problem, const FitParameters& beta,
                        Eigen::Index channel) {
  const SplitDelay split = split_delay(beta.input_delay_s[channel / problem.n_outputs] +
                                           beta.output_delay_s[channel % problem.n_outputs],
                                       problem.lines.sample_period_s);
  return split.whole + split.fraction;
}

}  // namespace

ParameterBounds::ParameterBounds(const FitProblem& problem, const FitParameters& start)
    : held_(problem.held) {
  const double lowest_line = problem.lines.omega_rad_s.minCoeff();
  const double highest_line = problem.lines.omega_rad_s.maxCoeff();
  highest_real_rad_s_ = kAboveLines * highest_line;
  highest_rad_s_ = problem.lines.hold == HoldModel::exact
                       ? std::max(kNearlyNyquist / problem.lines.sample_period_s, highest_line)
                       : highest_real_rad_s_;
  const auto searched_mode = [&](std::size_t i) {
    return start.a[i].size() == 2 &&
           (problem.roles.empty() || problem.roles[i] == SubmodelRole::searched);
  };
  double lowest = kBelowLines * lowest_line;
  for (std::size_t i = 0; i < start.a.size(); ++i)
    if (searched_mode(i)) lowest = std::min(lowest, slowest(start.a[i]));
  for (std::size_t i = 0; i < start.a.size(); ++i) {
    slow_damping_.push_back(!problem.roles.empty() && problem.roles[i] == SubmodelRole::suspension);
    lowest_rad_s_.push_back(
        searched_mode(i) ? lowest : std::min(kFarBelowLines * lowest_line, slowest(start.a[i])));
  }
}

void ParameterBounds::stabilize_mode(std::size_t i, const Eigen::VectorXd& before,
                                     Eigen::VectorXd& a) const {
  // A step that moves it too far is shortened, not refused: one mode must not stop all the others.
  constexpr double kMost = kLargestMove * kLargestMove;
  const double here = std::abs(before[1]);
  const double limited = std::clamp(a[1], here / kMost, here * kMost);
  if (limited != a[1]) a = before + (limited - before[1]) / (a[1] - before[1]) * (a - before);
  a[1] = std::clamp(a[1], 1.0 / (highest_rad_s_ * highest_rad_s_),
                    1.0 / (lowest_rad_s_[i] * lowest_rad_s_[i]));
  const double root = std::sqrt(a[1]);
  // An unstable start is reflected. A step towards instability ends at the bound, and the mode is then held there;
  // reflection would make it oscillate.
  double damping = before[0] > 0.0 ? std::max(a[0], 0.0) : std::abs(a[0]);
  // The lines hardly determine it: while the modes still move, it would run to a bound and remain there.
  if (slow_damping_[i])
    damping = std::clamp(damping, before[0] / kLargestMove, before[0] * kLargestMove);
  a[0] = 2.0 * root * std::clamp(damping / (2.0 * root), kSmallestDamping, kLargestDamping);
}

Complex ParameterBounds::contained(std::size_t i, Complex pole) const {
  const double size = std::abs(pole);
  if (pole.imag() == 0.0)
    return -std::clamp(size, lowest_rad_s_[i], std::max(highest_real_rad_s_, lowest_rad_s_[i]));
  const double damping = std::clamp(std::abs(pole.real()) / size, kSmallestDamping, 1.0);
  const double other = std::sqrt(std::max(1.0 - damping * damping, 0.0));
  const double kept = std::clamp(size, lowest_rad_s_[i], highest_rad_s_);
  return {-damping * kept, std::copysign(other * kept, pole.imag())};
}

bool ParameterBounds::stabilize_poles(std::size_t i, Eigen::VectorXd& a) const {
  if (!a.allFinite() || a[a.size() - 1] == 0.0) return false;
  std::vector<Complex> poles = roots(a);
  bool moved = false;
  for (Complex& pole : poles) {
    const Complex kept = contained(i, pole);
    // Do not change coefficients by mere rounding.
    if (!(std::abs(kept - pole) <= 1e-12 * std::abs(pole))) {
      pole = kept;
      moved = true;
    }
  }
  if (moved) a = denominator_of(poles);
  return a.allFinite();
}

bool ParameterBounds::stabilize(const FitParameters& before, FitParameters& beta) const {
  for (std::size_t i = 0; i < beta.a.size(); ++i) {
    Eigen::VectorXd& a = beta.a[i];
    if (a.size() == 2) {
      stabilize_mode(i, before.a[i], a);
    } else if (a.size() > 0) {
      if (!stabilize_poles(i, a)) return false;
    }
  }
  return true;
}

std::vector<Eigen::Index> ParameterBounds::leaning(const FitParameters& beta,
                                                   const Eigen::VectorXd& descent) const {
  std::vector<Eigen::Index> out = held_;
  out.insert(out.end(), held_delays_.begin(), held_delays_.end());
  Eigen::Index p = 0;
  for (std::size_t i = 0; i < beta.a.size(); ++i) {
    const Eigen::VectorXd& a = beta.a[i];
    if (a.size() == 1) {
      const bool below = 1.0 < a[0] * lowest_rad_s_[i] * kAtBound && descent[p] > 0.0;
      const bool above = kAtBound > a[0] * highest_real_rad_s_ && descent[p] < 0.0;
      if (below || above) out.push_back(p);
    } else if (a.size() == 2) {
      const double omega = 1.0 / std::sqrt(a[1]);
      const bool below = omega < lowest_rad_s_[i] * kAtBound && descent[p + 1] > 0.0;
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

std::vector<Eigen::Index> ParameterBounds::stop_at_jump(const FitProblem& problem,
                                                        const FitParameters& here,
                                                        Eigen::VectorXd& step) const {
  if (problem.lines.hold != HoldModel::exact || problem.delays() == 0) return {};
  const FitParameters beyond = stepped(problem, here, step.head(problem.globals()));
  double part = 1.0;  // of the step
  std::vector<Eigen::Index> passed;
  for (Eigen::Index c = 0; c < problem.channels(); ++c) {
    const double from = delay_in_samples(problem, here, c);
    const double to = delay_in_samples(problem, beyond, c);
    const double jump = to > from ? std::ceil(from) : std::floor(from);
    if (std::abs(to - from) <= std::abs(jump - from)) continue;
    const double here_on =
        std::max(0.0, (std::abs(jump - from) - kBesideJump) / std::abs(to - from));
    if (here_on > part) continue;
    if (here_on < part) passed.clear();
    part = here_on;
    for (const Eigen::Index p : delay_parameters(problem, c))
      if (std::ranges::find(passed, p) == passed.end()) passed.push_back(p);
  }
  step.segment(problem.denominators(), problem.delays()) *= part;
  return passed;
}

std::optional<Eigen::VectorXd> ParameterBounds::step_over_jump(const FitProblem& problem,
                                                               const FitParameters& here) const {
  if (problem.lines.hold != HoldModel::exact || problem.delay != DelayModel::estimate)
    return std::nullopt;
  const double samples = delay_in_samples(problem, here, 0);
  const double whole = std::round(samples);
  const double there = samples > whole ? whole : whole + kBesideJump;
  Eigen::VectorXd step = Eigen::VectorXd::Zero(problem.globals());
  step[problem.denominators()] = (there - samples) * problem.lines.sample_period_s;
  return step;
}

void ParameterBounds::drop_delays(std::vector<Eigen::Index>& frozen) const {
  std::erase_if(frozen, [this](Eigen::Index p) {
    return std::ranges::find(held_delays_, p) != held_delays_.end();
  });
}

bool ParameterBounds::at_bound(std::size_t i, const Eigen::VectorXd& a) const {
  const std::vector<Complex> poles = roots(a);
  return std::ranges::any_of(poles, [&](Complex pole) {
    const double size = std::abs(pole);
    const double highest = pole.imag() == 0.0 ? highest_real_rad_s_ : highest_rad_s_;
    return size < lowest_rad_s_[i] * kPoleAtBound || size * kPoleAtBound > highest ||
           -pole.real() < kSmallestDamping * size * kPoleAtBound;
  });
}

}  // namespace stageid
