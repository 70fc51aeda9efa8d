#include "frf/statistics/distributions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace stageid {
namespace {

constexpr double kRescaleAbove = 1e200;

}  // namespace

// With w = b / (b + a x) this is the incomplete beta function
//   I_w(b, a) = w^b sum_{j < a} Gamma(b + j) / (Gamma(b) j!) (1 - w)^j.
double log_tail_of_f(double x, int a, double b) {
  // Uses the odds (1 - w) / w: for nearly noise-free data w is so small that 1 - w rounds to one. The limit keeps the
  // result finite.
  const double odds = std::min(a * x / b, std::numeric_limits<double>::max());
  const double rest = odds < 1.0 ? odds / (1.0 + odds) : 1.0 / (1.0 + 1.0 / odds);  // 1 - w
  double term = 1.0;
  double sum = 1.0;
  double log_scale = 0.0;
  for (int j = 1; j < a; ++j) {
    term *= (b + j - 1.0) / j * rest;
    sum += term;
    if (sum < kRescaleAbove) continue;  // overflows for thousands of degrees of freedom otherwise
    log_scale += std::log(sum);
    term /= sum;
    sum = 1.0;
  }
  return std::min(0.0, std::log(sum) - b * std::log1p(odds) + log_scale);
}

double tail_of_evidence(double h, Eigen::Index K) {
  if (!(h > 0.0) || K == 0) return 1.0;
  if (std::isinf(h)) return 0.0;
  double sum = 0.0;
  for (Eigen::Index j = 0; j < K; ++j) {
    const double n = static_cast<double>(j);
    sum += std::exp(n * std::log(h) - std::lgamma(n + 1.0) - h);
  }
  return std::min(1.0, sum);
}

double tail_of_chi_square(double x, double n) {
  const double variance = 2.0 / (9.0 * n);
  return tail_of_normal((std::cbrt(x / n) - 1.0 + variance) / std::sqrt(variance));
}

double tail_of_normal(double z) { return 0.5 * std::erfc(z / std::numbers::sqrt2); }

}  // namespace stageid
