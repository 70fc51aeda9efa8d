#include "estimation/tracking/change_detector.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "excitation/decompositions/decompositions.hpp"
#include "excitation/multisine/random_stream.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

/// Longest window in periods. What is slower than that reaches the same statistic later.
constexpr int kLongest = 512;
/// Simulated lives for the threshold, and periods of each. The rate of alarms is then within 15 %.
constexpr int kLives = 128;
constexpr int kLife = 512;

/// c sqrt(t) e^{-t/2} = rate for t, given its value at t0.
double continued_threshold(double t0, double rate0, double rate) {
  double t = t0;
  for (int i = 0; i < 50; ++i)
    t = std::max(1.0, t0 + 2.0 * std::log(rate0 / rate) + std::log(t / t0));
  return t;
}

/// Normal and chi-square numbers that are the same on every machine.
class RandomScores {
 public:
  explicit RandomScores(std::uint64_t seed) : uniform_(seed) {}
  double normal() {
    if (second_) return *std::exchange(second_, std::nullopt);
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform_.next()));
    const double angle = 2.0 * std::numbers::pi * uniform_.next();
    second_ = radius * std::sin(angle);
    return radius * std::cos(angle);
  }
  /// Over its mean. Source: G. Marsaglia and W. W. Tsang, ACM Trans. Math. Softw. 26 (2000) 363.
  /// @pre freedom >= 2
  double chi_square(double freedom) {
    const double d = 0.5 * freedom - 1.0 / 3.0;
    for (;;) {
      const double x = normal();
      const double root = 1.0 + x / std::sqrt(9.0 * d);
      const double v = root * root * root;
      if (v > 0.0 && std::log(1.0 - uniform_.next()) < 0.5 * x * x + d * (1.0 - v + std::log(v)))
        return d * v / (0.5 * freedom);
    }
  }

 private:
  UniformStream uniform_;
  std::optional<double> second_;  // of the pair of the Box-Muller transform
};

}  // namespace

ChangeDetector::ChangeDetector(const Eigen::MatrixXd& correlation, Eigen::VectorXd freedom,
                               double false_alarms_per_period, int reference_periods)
    : freedom_(std::move(freedom)),
      reference_periods_(reference_periods),
      sums_(Eigen::ArrayXXd::Zero(correlation.rows(), kLongest + 1)) {
  require(correlation.allFinite() && freedom_.allFinite(),
          "the scatter of the learned periods is not a number; check the recorded signals");
  calibrate(correlation, false_alarms_per_period);
}

void ChangeDetector::restart() {
  count_ = 0;
  sums_.col(0).setZero();
}

Eigen::ArrayXd ChangeDetector::sum_of(std::int64_t periods) const {
  return sums_.col(count_ % sums_.cols()) - sums_.col((count_ - periods) % sums_.cols());
}

Eigen::ArrayXd ChangeDetector::statistics(std::int64_t periods) const {
  const auto w = static_cast<double>(periods);
  const Eigen::ArrayXd square = sum_of(periods).square() / (w * (1.0 + w / reference_periods_));
  return freedom_ * (square / freedom_).log1p();
}

Eigen::Index ChangeDetector::scan() {
  Eigen::Index best = 0;
  largest_ = -1.0;
  by_hypothesis_ = Eigen::ArrayXd::Zero(freedom_.size());
  for (int w = 1; w <= std::min<std::int64_t>(count_, kLongest); w *= 2) {
    Eigen::Index h = 0;
    const Eigen::ArrayXd values = statistics(w);
    by_hypothesis_ = by_hypothesis_.max(values);
    const double value = values.maxCoeff(&h);
    if (value <= largest_) continue;
    largest_ = value;
    window_ = w;
    best = h;
  }
  return best;
}

int ChangeDetector::add(const Eigen::VectorXd& scores) {
  const Eigen::Index now = count_ % sums_.cols();
  ++count_;
  sums_.col(count_ % sums_.cols()) = sums_.col(now) + scores.array();
  const Eigen::Index hypothesis = scan();
  if (largest_ < threshold_) return 0;
  int periods = window_;
  for (int w = 1; w <= std::min<std::int64_t>(count_, kLongest); ++w)
    if (statistics(w)[hypothesis] > statistics(periods)[hypothesis]) periods = w;
  return periods;
}

void ChangeDetector::calibrate(const Eigen::MatrixXd& correlation, double false_alarms_per_period) {
  const auto eigen = symmetric_eigen(correlation);
  const Eigen::MatrixXd root =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  RandomScores random(1);
  const auto draw = [&]() -> Eigen::VectorXd {
    return root * Eigen::VectorXd::NullaryExpr(root.cols(), [&] { return random.normal(); });
  };
  threshold_ = std::numeric_limits<double>::infinity();
  std::vector<double> maxima;
  for (int life = 0; life < kLives; ++life) {
    restart();
    const Eigen::VectorXd error = draw() / std::sqrt(reference_periods_);
    const Eigen::ArrayXd scale =
        freedom_.unaryExpr([&](double nu) { return 1.0 / std::sqrt(random.chi_square(nu)); });
    double largest = 0.0;
    for (int t = 0; t < kLife; ++t) {
      add(scale * (draw() - error).array());
      largest = std::max(largest, largest_);
    }
    maxima.push_back(largest);
  }
  std::nth_element(maxima.begin(), maxima.begin() + kLives / 2, maxima.end());
  threshold_ =
      continued_threshold(maxima[kLives / 2], std::log(2.0) / kLife, false_alarms_per_period);
  restart();
}

}  // namespace stageid
