#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/tracking/model_tracker.hpp"
#include "estimation/tracking/tracked_response.hpp"

namespace stageid {

/// How one line of the outputs' spectrum, divided by its noise, depends on the tracked parameters: for every excitation
/// signal C^(-1/2) dY/dx if this signal alone is one, n_y x parameters.
using LineSensitivity = std::vector<Eigen::MatrixXcd>;

/// @param U  inputs of the plant if one signal is one: by line, n_u x signals
/// @param C  covariance of the outputs' spectrum in one period: by line, n_y x n_y
std::vector<LineSensitivity> line_sensitivities(const TrackedResponse& response,
                                                const std::vector<Eigen::MatrixXcd>& U,
                                                const std::vector<Eigen::MatrixXcd>& C);

/// The free motions of a body that no spring holds, divided by the noise like the sensitivities: by line, n_y x any.
std::vector<Eigen::MatrixXcd> line_motions(const TrackedResponse& response,
                                           const std::vector<Eigen::MatrixXcd>& C);

/// J = sum_j r_j J_j, n_y x parameters.
Eigen::MatrixXcd sensitivity(const LineSensitivity& line, const Eigen::VectorXcd& r);

/// Fisher information of one period on the tracked parameters, 2 Re J^H J.
Eigen::MatrixXd information(const Eigen::MatrixXcd& J);

/// Power of the lines for the smallest variances.
struct InformativePower {
  Eigen::VectorXd power;     ///< p, by line
  Eigen::VectorXd variance;  ///< of each parameter over the square of its scale; 0 without scale
  /// V, parameters x parameters with scale: d_k = tr(V^T M_k V)
  Eigen::MatrixXd gradient_root;
  double gap = 0.0;  ///< ln of the largest variance is at most this far above its minimum
};

/// Solves   min over p >= 0 of max over i of (M^-1)_ii / scale_i^2,   M = prior + sum_k p_k M_k,   subject to B p <= 1
/// by the multiplicative algorithm
///   p_k <- p_k d_k / (B^T lambda)_k,   d_k = sum_i w_i m_i^T M_k m_i / (M^-1)_ii,   m_i column i of M^-1.
/// d is the gradient of -sum_i w_i ln (M^-1)_ii. The weights w follow the variances, the multipliers lambda follow B p.
/// With one parameter this is the D-optimal design.
/// Source: S. D. Silvey, D. M. Titterington and B. Torsney, An algorithm for optimal designs on a finite design space,
/// Commun. Statist. A 7 (1978); F. Pukelsheim, Optimal Design of Experiments (1993).
/// @param information M_k, by line   @param scale  of the parameters that matter; 0: of the others
/// @param bounds B, mean squares of signals over their limits, signals x lines
InformativePower most_informative_power(const std::vector<Eigen::MatrixXd>& information,
                                        const Eigen::MatrixXd& prior, const Eigen::VectorXd& scale,
                                        const Eigen::MatrixXd& bounds, int iterations = 100);

/// Phases of the signals on a line, |r_j| = 1: a local maximum of tr(V^T M_k V) near `r`.
Eigen::VectorXcd most_informative_phases(const LineSensitivity& line, const Eigen::MatrixXd& V,
                                         Eigen::VectorXcd r);

/// What ModelTracker will know.
struct WatchForecast {
  Eigen::VectorXd deviation;  ///< of an estimate from one period, by tracked parameter
  /// Periods from a change of the given size to its name, expected; infinite if above 512.
  Eigen::VectorXd periods;
};

/// @param J        sensitivity() of the excitation, by line
/// @param motions  line_motions(); the tracker removes them
/// @param change   size of the change of each parameter
WatchForecast watch_forecast(const std::vector<Eigen::MatrixXcd>& J,
                             const std::vector<Eigen::MatrixXcd>& motions,
                             const Eigen::MatrixXd& prior, const Eigen::VectorXd& change,
                             const TrackerOptions& options);

}  // namespace stageid
