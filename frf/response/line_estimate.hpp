#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace stageid {

enum class LineStatus : std::uint8_t { good, singular_excitation, singular_inputs };

/// One realization on one line. Symbols: R axes x E, Z = [Y; U] (n_y + n_u) x E, n_u = axes <= E.
struct LineEstimate {
  LineStatus status = LineStatus::good;
  Eigen::MatrixXcd Z_by_R;       ///< Z R^+, (n_y + n_u) x axes; least squares if E > axes
  Eigen::MatrixXcd Q;            ///< E x n_u, G = Y Q: U^-1 if E = n_u, otherwise R^+ (U R^+)^-1
  Eigen::MatrixXcd G;            ///< n_y x n_u
  double input_condition = 0.0;  ///< |U| |Q| in the spectral norm: cond(U) if E = n_u
};

LineEstimate estimate_line(const Eigen::MatrixXcd& R, const Eigen::MatrixXcd& Z,
                           Eigen::Index outputs);

}  // namespace stageid
