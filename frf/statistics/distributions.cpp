#include "frf/statistics/distributions.hpp"

#include <algorithm>
#include <boost/math/special_functions/digamma.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <boost/math/special_functions/trigamma.hpp>
#include <cmath>
#include <limits>
#include <numbers>

namespace stageid {
namespace {

constexpr double kRescaleAbove = 1e200;

/// Boost returns NaN instead of throwing: the callers check their data and have their own messages.
namespace policies = boost::math::policies;
using Quiet = policies::policy<
    policies::domain_error<policies::ignore_error>, policies::pole_error<policies::ignore_error>,
    policies::overflow_error<policies::ignore_error>,
    policies::evaluation_error<policies::ignore_error>,
    policies::rounding_error<policies::ignore_error>, policies::promote_double<false>>;

}  // namespace

// Boost has no logarithm of the incomplete beta function, which underflows here.
// With w = b / (b + a x) that is the incomplete beta function
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
  return !(h > 0.0) || K == 0 ? 1.0 : tail_of_chi_square(2.0 * h, 2.0 * static_cast<double>(K));
}

double tail_of_chi_square(double x, double n) {
  return x <= 0.0 ? 1.0 : boost::math::gamma_q(0.5 * n, 0.5 * x, Quiet());
}

double tail_of_normal(double z) { return 0.5 * std::erfc(z / std::numbers::sqrt2); }

double log_gamma(double x) noexcept {
  int sign = 0;
  return ::lgamma_r(x, &sign);
}

double mean_of_log_power(double dof) { return boost::math::digamma(dof, Quiet()) - std::log(dof); }

double variance_of_log_power(double dof) { return boost::math::trigamma(dof, Quiet()); }

}  // namespace stageid
