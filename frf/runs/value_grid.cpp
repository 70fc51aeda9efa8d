#include "frf/runs/value_grid.hpp"

#include <algorithm>
#include <cmath>

namespace stageid {
namespace {

constexpr int kMostTaken = 4096;
constexpr double kFinest = 1e-6;    // step, of the largest value
constexpr double kRounding = 1e-8;  // a remainder, of the same: far above that of double precision

}  // namespace

void ValueGrid::add(const Eigen::Ref<const Eigen::VectorXd>& samples) noexcept {
  for (Eigen::Index i = 0; i < samples.size() && taken_ < kMostTaken && !continuous_; ++i)
    take(samples[i]);
}

void ValueGrid::add(const ValueGrid& other) noexcept {
  if (other.taken_ == 0) return;
  take(other.last_);
  largest_ = std::max(largest_, other.largest_);
  continuous_ = continuous_ || other.continuous_;
  divide(other.step_);
  taken_ += other.taken_;
}

void ValueGrid::take(double value) noexcept {
  if (taken_++ == 0) last_ = value;
  largest_ = std::max(largest_, std::abs(value));
  divide(std::abs(value - last_));
  last_ = value;
}

/// Euclid's algorithm; remainders within rounding are zero. Each quotient multiplies the rounding error of the divisor,
/// so that the difference, a multiple of it, corrects it.
void ValueGrid::divide(double difference) noexcept {
  const double zero = kRounding * largest_;
  for (double divisor = difference; divisor > zero;) {
    const double rest = std::abs(std::remainder(step_, divisor));
    step_ = divisor;
    divisor = rest;
  }
  if (const double times = std::round(difference / step_); times >= 1.0) step_ = difference / times;
  continuous_ = continuous_ || (step_ > 0.0 && step_ < kFinest * largest_);
}

}  // namespace stageid
