#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <string>

#include "estimation/model/additive_model.hpp"
#include "excitation/words/words.hpp"
#include "frf/response/distortion_variance.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

class Team;

/// The variance of the data with which a residual is compared.
enum class ResidualVariance : std::uint8_t {
  none,   ///< the data have no variances, and too few lines
  noise,  ///< from periods
  total,  ///< noise and stochastic nonlinear contributions: from realizations, or known from others
  /// From neighbouring lines, see line_scatter(): of the response, where one realization was measured; of the
  /// residual, where the data have no variances.
  scatter
};
template <>
inline constexpr std::array kWords<ResidualVariance> = {"none", "noise", "total", "scatter"};

/// Whether the residual of a model is noise and known distortion.
struct ResidualVerdict {
  ResidualVariance variance = ResidualVariance::none;
  Eigen::MatrixXd scatter;  ///< (n_y n_u) x N: the variance used, unless it is part of the data
  double dof = 0.0;         ///< nu, complex degrees of freedom of the variance; 0: exact
  double chi_square = 0.0;  ///< mean of r = |E|^2 / variance over entries and lines; 0: unknown
  /// Mean of r if the error is noise: nu / (nu - 1), or 1 for an exact variance; 0: infinite.
  double expected = 0.0;
  bool explained = true;  ///< true also if nothing can be compared
  std::string reason;     ///< the reason if not explained, one sentence
};

/// Neighbouring channels on neighbouring lines.
struct ResponseBlock {
  Eigen::Index first_channel;
  Eigen::Index channels;
  Eigen::Index first_line;
  Eigen::Index lines;
};

/// The response of a model in a block, channels x lines, as measured.
using ModelBlockResponse = std::function<Eigen::MatrixXcd(const ResponseBlock& block)>;

/// Compares the residual of a model with the variances of the data, one block after another.
///
/// A residual whose power is a times the variance has r/a ~ F(2, 2 nu), so that
///   t = nu ln(1 + r/(a nu))  is exponential with mean 1, for any nu (t = r/a for an exact variance).
/// The test uses a = 2: the error of the model is then as large as the noise. A part of the data is not explained if
/// its mean t exceeds 1 beyond chance. Parts are all data, every output, every input, and runs of neighbouring lines.
/// Channels of a line count as fully correlated: a part has as many independent numbers as lines.
/// The noise variance is compared first. If it does not explain the residual, the total variance is compared, or for
/// one realization the scatter of the lines, if most of them scatter by more than their noise: they contain the
/// distortion of a nonlinear plant. The figures refer to the variance that explains the residual, else to the noise.
/// Data without any variance are judged by the residual itself: noise scatters from line to line, and what a model
/// misses is smooth.
/// Source: the tail of F(2, 2 nu) is (1 + x/nu)^-nu; minus its logarithm is exponential for any continuous
/// distribution.
/// @param known distortion of one realization, from the fit of the model; used if there is no total variance
/// @param weights of a fit, (n_y n_u) x N: entries of weight 0 are not judged; empty: all are judged
/// @param team of processes that share the channels; null: that of the data
/// @throws std::invalid_argument if shapes do not match
ResidualVerdict judge_residual(const FrfEstimate& frf, const ModelBlockResponse& model,
                               const Eigen::MatrixXd& weights = {}, int threads = 0,
                               const Distortion& known = {}, const Team* team = nullptr);

}  // namespace stageid
