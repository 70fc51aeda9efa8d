#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>

#include "frf/response/distortion_variance.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Which variance of the data a residual is compared with.
enum class ResidualVariance : std::uint8_t {
  none,   ///< the data have no variances
  noise,  ///< from periods
  total,  ///< noise and stochastic nonlinear contributions: from realizations, or known from others
  scatter  ///< from neighbouring lines, where one realization was measured: see line_scatter()
};
const char* to_string(ResidualVariance variance) noexcept;

/// Whether what a model leaves of measured data is noise and known distortion.
struct ResidualVerdict {
  ResidualVariance variance = ResidualVariance::none;
  Eigen::MatrixXd scatter;  ///< (n_y n_u) x N: that variance, unless it is one of the data's own
  double dof = 0.0;         ///< nu, complex degrees of freedom of the variance; 0: exact
  double chi_square = 0.0;  ///< mean of r = |E|^2 / variance over entries and lines; 0: unknown
  /// Mean of r if the error is noise: nu / (nu - 1), or 1 for an exact variance; 0: no mean exists.
  double expected = 0.0;
  bool explained = true;  ///< true also where the data have no variances
  std::string reason;     ///< why not, one sentence; empty if explained
};

/// The response of a model on the lines [first, first + count), (n_y n_u) x count, as measured.
using ModelLinesResponse = std::function<Eigen::MatrixXcd(Eigen::Index first, Eigen::Index count)>;

/// Compares what a model leaves of the data with their variances, a tile of lines after the other.
///
/// A residual whose power is a times the variance has r/a ~ F(2, 2 nu), so that
///   t = nu ln(1 + r/(a nu))  is exponential with mean 1, whatever nu (t = r/a for an exact variance).
/// Tested is a = 2, where the error of the model is as large as the noise. A part of the data whose mean t exceeds 1
/// beyond chance is not explained. Parts are all data, every output, every input, and runs of neighbouring lines. Channels
/// of a line count as fully correlated: a part has as many independent numbers as lines.
/// The noise variance is asked first. What it does not explain is compared with the total variance, or for one
/// realization with the scatter of the lines: they contain the distortion of a nonlinear plant. The figures are those of
/// the variance that explains it, else of the noise.
/// Source: the tail of F(2, 2 nu) is (1 + x/nu)^-nu; minus its logarithm is exponential for any continuous distribution.
/// @param known distortion of one realization that the fit of the model has seen: asked where there is no total variance
/// @param weights of a fit, (n_y n_u) x N: entries of weight 0 are not judged; empty: all are
/// @throws std::invalid_argument if shapes do not agree
ResidualVerdict judge_residual(const FrfEstimate& frf, const ModelLinesResponse& model,
                               const Eigen::MatrixXd& weights = {}, int threads = 0,
                               const Distortion& known = {});

}  // namespace stageid
