#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <utility>

#include "excitation/multisine/random_stream.hpp"

namespace stageid::test {

/// Numbers that are the same on every machine.
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t seed) : state_(seed) {}
  std::uint64_t number() {
    return splitmix64(std::exchange(state_, state_ + kSplitMix64Increment));
  }
  double uniform(double low = 0.0, double high = 1.0) {
    return low + (high - low) * static_cast<double>(number() >> 11) * 0x1p-53;
  }
  int integer(int low, int high) {  ///< both included
    return low + static_cast<int>(uniform() * static_cast<double>(high - low + 1));
  }
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }
  std::complex<double> circular() {  ///< E|v|^2 = 1, E v^2 = 0
    const double radius = std::sqrt(-std::log(1.0 - uniform()));
    return std::polar(radius, 2.0 * std::numbers::pi * uniform());
  }
  /// chi^2 of 2 dof real degrees over its mean. A sum of dof exponential numbers; above 30 the normal approximation
  /// of its cube root (Wilson and Hilferty) is as good.
  double chi_square_mean(double dof) {
    if (dof <= 30.0) {
      double sum = 0.0;
      for (int i = 0; i < static_cast<int>(dof); ++i) sum -= std::log(1.0 - uniform());
      return sum / dof;
    }
    const double spread = 1.0 / (9.0 * dof);
    const double root = 1.0 - spread + normal() * std::sqrt(spread);
    return root * root * root;
  }

 private:
  std::uint64_t state_;
};

/// The upper median.
inline double median_of(Eigen::VectorXd values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

inline Eigen::VectorXd random_vector(RandomNumbers& random, Eigen::Index size, double scale = 1.0) {
  Eigen::VectorXd out(size);
  for (double& value : out) value = scale * random.normal();
  return out;
}

inline Eigen::MatrixXd random_matrix(RandomNumbers& random, Eigen::Index rows,
                                     Eigen::Index columns) {
  Eigen::MatrixXd out(rows, columns);
  for (double& value : out.reshaped()) value = random.normal();
  return out;
}

inline Eigen::MatrixXcd circular_matrix(RandomNumbers& random, Eigen::Index rows,
                                        Eigen::Index columns) {
  Eigen::MatrixXcd out(rows, columns);
  for (std::complex<double>& value : out.reshaped()) value = random.circular();
  return out;
}

/// L with C = L L^H; Eigen's takes seconds to compile.
inline Eigen::MatrixXcd cholesky(const Eigen::MatrixXcd& C) {
  Eigen::MatrixXcd L = Eigen::MatrixXcd::Zero(C.rows(), C.cols());
  for (Eigen::Index j = 0; j < C.cols(); ++j)
    for (Eigen::Index i = j; i < C.rows(); ++i) {
      std::complex<double> rest = C(i, j);
      for (Eigen::Index k = 0; k < j; ++k) rest -= L(i, k) * std::conj(L(j, k));
      L(i, j) = i == j ? std::sqrt(rest.real()) : rest / L(j, j).real();
    }
  return L;
}

}  // namespace stageid::test
