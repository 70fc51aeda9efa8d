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

/// First-order noise covariance of one realization's G on one line.
///
/// dG = sum_e dE_e (row e of Q), dE = [I, -G] dZ. With q_e that row as a column,
///   Cov(vec G) = sum_e (q_e q_e^H) kron C_Ee = A kron C_E,  A = sum_e q_e q_e^H / P_e,
/// where C_E, the covariance of one period's dE, is pooled over the experiments: in the loop, dE is the open-loop
/// noise for any excitation (docs/theory.md, section 3). If the noise itself differs between experiments, it is
/// not pooled: ExperimentNoise.
/// Complex variances are E|v|^2, without a factor 1/2.
struct LineNoise {
  Eigen::MatrixXcd input_part;   ///< A, n_u x n_u
  Eigen::MatrixXcd residual;     ///< C_E of one period, n_y x n_y
  Eigen::MatrixXd gain;          ///< n_y x n_u: variance of G over diag(C_E); A_jj for common C_E
  double mean_of_periods = 1.0;  ///< mean over the experiments of 1 / P_e
};

/// [I, -G], which takes Z = [Y; U] to Y - G U.
Eigen::MatrixXcd residual_of_Z(const Eigen::MatrixXcd& G);

/// C_E of one period: [I, -G] scatter [I, -G]^H / dof, n_y x n_y, Hermitian in spite of rounding.
Eigen::MatrixXcd residual_covariance(const Eigen::MatrixXcd& G, const Eigen::MatrixXcd& scatter,
                                     int dof);

/// `scatter`: sum over experiments and periods of dZ dZ^H, with `dof` degrees of freedom; `periods`: P_e, one value
/// per experiment.
LineNoise line_noise(const LineEstimate& estimate, const Eigen::MatrixXcd& scatter, int dof,
                     const Eigen::VectorXd& periods);

}  // namespace stageid
