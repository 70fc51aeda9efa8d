#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/additive_model.hpp"

namespace stageid {

/// The lines of a fit and how a continuous-time model is seen on them.
struct ModelLines {
  Eigen::VectorXd omega_rad_s;
  double sample_period_s = 0.0;  ///< needed unless hold is none
  HoldModel hold = HoldModel::none;
};

/// Which rational functions s^m / (s^l A(s)), A of order n, m = 0 .. degree.
struct SubmodelShape {
  int integrators = 0;       ///< l, 0 to 2
  int order = 0;             ///< n
  int numerator_degree = 0;  ///< m
  int functions() const noexcept { return numerator_degree + 1; }
};

/// One submodel's functions of frequency on the lines, through hold, delay and sampler.
struct SubmodelBasis {
  Eigen::MatrixXcd value;     ///< N x (m+1):  H{ s^p / (s^l A) }
  Eigen::MatrixXcd gradient;  ///< N x (m+1) n: its derivative to a_q in column p n + (q-1)
  Eigen::MatrixXcd delay;     ///< N x (m+1): its derivative to the delay
};

/// The poles of A(s) = 1 + a_1 s + ... + a_n s^n.
std::vector<std::complex<double>> roots(const Eigen::Ref<const Eigen::VectorXd>& a);

/// Evaluates the functions of one submodel with denominator coefficients a (size n).
///
/// Every function is written in partial fractions, and hold, delay and sampler act on each fraction
/// 1/(s - lambda) and 1/(s - lambda)^2 in closed form (docs/theory of method.md section 4): with
/// delay = (d + f) T, E = e^{lambda T}, e_1 = e^{lambda (1-f) T}, phi(t) = (e^{lambda t} -
/// 1)/lambda,
///   H{1/(s - lambda)} = z^-d [ z^-1 phi((1-f) T) + z^-2 phi(T) e_1 / (1 - E z^-1) ],
/// and H{1/(s - lambda)^2} is its derivative to lambda.
/// @pre the poles are simple and not zero; the function is not improper.
void evaluate_basis(const ModelLines& lines, const SubmodelShape& shape,
                    const Eigen::Ref<const Eigen::VectorXd>& a, double delay_s, bool with_gradient,
                    SubmodelBasis& out);

}  // namespace stageid
