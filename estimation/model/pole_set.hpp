#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/model/hold_equivalent.hpp"

namespace stageid {

/// Poles of a real rational function of x: the upper one of each conjugate pair, and the real ones.
struct PoleSet {
  std::vector<std::complex<double>> pairs;
  std::vector<double> reals;

  /// Number of real coefficients of a sum over all poles.
  Eigen::Index size() const noexcept {
    return static_cast<Eigen::Index>(2 * pairs.size() + reals.size());
  }
};

/// Partial fractions with real coefficients on every line, N x size(): columns 1/(x-p) + 1/(x-p*) and j/(x-p) -
/// j/(x-p*) per pair, 1/(x-p) per real pole.
SplitMatrix partial_fractions(const PoleSet& poles, const Eigen::VectorXcd& x);

/// The zeros of  1 + sum_i c_i phi_i(x),  phi the partial fractions: eigenvalues of the poles' real block
/// matrix minus b c^T (Gustavsen and Semlyen 1999, eq. B.1). @param c size()
Eigen::VectorXcd zeros_of_sum(const PoleSet& poles, const Eigen::VectorXd& c);

}  // namespace stageid
