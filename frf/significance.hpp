#pragma once

#include <Eigen/Core>

namespace stageid {

/// ln P(F > x) for F(2 a, 2 b), a whole: with w = b / (b + a x) that is the incomplete beta function
///   I_w(b, a) = w^b sum_{j < a} Gamma(b + j) / (Gamma(b) j!) (1 - w)^j.
double log_tail_of_f(double x, int a, double b);

/// P(chi-square with 2 K degrees of freedom > 2 h) = exp(-h) sum_{j < K} h^j / j!; with h the sum of
/// -ln p over K independent tests, Fisher's p-value of all of them together.
double tail_of_chi_square(double h, Eigen::Index K);

}  // namespace stageid
