#pragma once

#include <Eigen/Core>

namespace stageid {

/// What rounding errors leave of a power in double precision, if there is no noise.
inline constexpr double kPowerRounding = 1e-24;

/// ln P(F > x) of a ratio of mean powers of complex Gaussian noise: F(2 a, 2 b), a a whole and b any positive number of
/// complex degrees of freedom.
double log_tail_of_f(double x, int a, double b);

/// P(h_1 + ... + h_K > h) for independent h_k = -ln p_k, p_k uniform (Fisher's sum): half a
/// chi-square variable with 2 K degrees of freedom. 1 if K is 0.
double tail_of_evidence(double h, Eigen::Index K);

/// P(chi-square with n > 0 degrees of freedom > x), n not necessarily whole.
double tail_of_chi_square(double x, double n);

/// P(Z > z) of a standard normal variable.
double tail_of_normal(double z);

/// ln |Gamma(x)|. From any thread: std::lgamma() writes the sign to a global variable.
double log_gamma(double x) noexcept;

/// Mean and variance of the logarithm of a mean power of complex Gaussian noise whose true value is 1,
/// with dof > 0 complex degrees of freedom: psi(dof) - ln dof and psi'(dof).
double mean_of_log_power(double dof);
double variance_of_log_power(double dof);

}  // namespace stageid
