#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/model/additive_model.hpp"

// A second, independent implementation of an additive model: rational functions term by term, and hold, delay and
// sampler by a matrix exponential in extended precision or by the aliasing sum. Uses only the structs of the library,
// not its evaluation.

namespace stageid::test {

/// s^power / (s^integrators (1 + a_1 s + ... + a_n s^n)).
struct RationalFunction {
  int integrators = 0;
  std::vector<double> a;  ///< a_1 ... a_n
  int power = 0;

  int order() const { return integrators + static_cast<int>(a.size()); }
  int relative_degree() const { return order() - power; }
};

/// A mode's a_1, a_2.
std::vector<double> mode_coefficients(double frequency_hz, double damping_ratio);

/// The function at s, summed term by term.
std::complex<double> evaluate(const RationalFunction& function, std::complex<double> s);

/// The function behind a zero-order hold and a delay, sampled: from the state space in controllable
/// form, its matrix exponential and the two input matrices of a delay of a non-integer number of
/// samples, in long double.
std::complex<double> sampled(const RationalFunction& function, double omega_rad_s, double period_s,
                             double delay_s);

/// The same from  (1/T) sum_{|n| <= terms} G(s_n) (1 - e^{-s_n T}) / s_n e^{-s_n tau},
/// s_n = j (omega + n 2 pi / T).
struct AliasingSum {
  std::complex<double> value;
  double tail = 0.0;  ///< bound of the omitted terms
};
AliasingSum aliasing_sum(const RationalFunction& function, double omega_rad_s, double period_s,
                         double delay_s, int terms);

/// One function through any hold model and a delay.
std::complex<double> through(const RationalFunction& function, HoldModel hold, double omega_rad_s,
                             double period_s, double delay_s);

/// vec P(j omega_k) of a whole model with its delays, (n_y n_u) x N.
Eigen::MatrixXcd reference_response(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz,
                                    HoldModel hold);

/// 1/(2N) sum vec(E)^H W vec(E), E = G - P, entry by entry.
double reference_cost(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz,
                      HoldModel hold, const Eigen::MatrixXcd& G, const Eigen::MatrixXd& W);

}  // namespace stageid::test
