#pragma once

#include <numbers>

#include "estimation/modal/sampled_state_space.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid::test {

/// vec of C (x I - A)^-1 B + D by a dense solver that does not use blocks.
inline Eigen::VectorXcd transfer(const StateSpace& system, std::complex<double> x) {
  const Eigen::MatrixXcd left =
      x * Eigen::MatrixXcd::Identity(system.order(), system.order()) - system.A;
  const Eigen::MatrixXcd states = solve(left, system.B.cast<std::complex<double>>());
  return (system.C * states + system.D).reshaped();
}

/// (n_y n_u) x N, as response() without delays.
inline Eigen::MatrixXcd response_of(const StateSpace& system, const Eigen::VectorXd& frequency_hz) {
  Eigen::MatrixXcd out(system.D.size(), frequency_hz.size());
  for (Eigen::Index k = 0; k < frequency_hz.size(); ++k)
    out.col(k) = transfer(system, {0.0, 2.0 * std::numbers::pi * frequency_hz[k]});
  return out;
}

/// The same of a sampled system, with its whole samples of delay.
inline Eigen::MatrixXcd response_of(const SampledStateSpace& sampled,
                                    const Eigen::VectorXd& frequency_hz) {
  const Eigen::Index n_y = sampled.system.D.rows();
  Eigen::MatrixXcd out(sampled.system.D.size(), frequency_hz.size());
  for (Eigen::Index k = 0; k < frequency_hz.size(); ++k) {
    const double angle = 2.0 * std::numbers::pi * frequency_hz[k] / sampled.sample_rate_hz;
    out.col(k) = transfer(sampled.system, std::polar(1.0, angle));
    for (Eigen::Index c = 0; c < out.rows(); ++c)
      out(c, k) *=
          std::polar(1.0, -angle * static_cast<double>(sampled.output_delay_samples[c % n_y] +
                                                       sampled.input_delay_samples[c / n_y]));
  }
  return out;
}

/// Smallest over largest singular value of [B, A B, ..., A^n-1 B], A scaled to norm one: 0 if (A, B) is
/// not controllable; of (A^T, C^T), if (A, C) is not observable.
inline double controllability(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  const Eigen::MatrixXd scaled = A / A.norm();
  Eigen::MatrixXd all(A.rows(), A.rows() * B.cols());
  Eigen::MatrixXd power = B;
  for (Eigen::Index k = 0; k < A.rows(); ++k, power = scaled * power)
    all.middleCols(k * B.cols(), B.cols()) = power;
  const Eigen::VectorXd values = svd(all, 0).singularValues();
  return values.tail(1).value() / values[0];
}

/// The largest |a - b| of a line relative to the norm of b there.
inline double largest_deviation(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b) {
  return ((a - b).colwise().norm().array() / b.colwise().norm().array()).maxCoeff();
}

}  // namespace stageid::test
