#pragma once

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <random>

namespace stageid::test {

/// Uniform and normal numbers that do not depend on the standard library's distributions.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1.0p-53; }
  double normal() {
    return std::sqrt(-2.0 * std::log(1.0 - uniform())) *
           std::cos(2.0 * std::numbers::pi * uniform());
  }
  /// E|z|^2 = 1.
  std::complex<double> circular() {
    const double re = normal();
    return std::complex<double>(re, normal()) / std::sqrt(2.0);
  }

 private:
  std::mt19937_64 engine_;
};

/// Circular Gaussian noise of the variance on every number.
Eigen::MatrixXcd with_noise(const Eigen::MatrixXcd& response, const Eigen::MatrixXd& variance,
                            Random& random);

}  // namespace stageid::test
