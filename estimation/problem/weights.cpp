#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "estimation/problem/weight_matrices.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {
namespace {

/// Degrees of freedom that a variance should have before it is used as a weight: the scatter of the weights then costs
/// 4 % of the efficiency. Smoothing costs more where the variance itself has resonances.
constexpr double kWantedDof = 25.0;
// With fewer degrees of freedom after smoothing, the scatter of the inverse is infinite or nearly so. Only possible
// with a handful of lines.
constexpr double kLeastTogether = 4.0;

std::string channel_name(const FrfEstimate& frf, Eigen::Index c, Eigen::Index k) {
  return frf.outputs.names[c % frf.n_outputs()] + " <- " + frf.inputs.names[c / frf.n_outputs()] +
         " at " + std::to_string(frf.frequency_hz[k]) + " Hz";
}

/// Neighbours on each side of a line whose mean has the scatter of a variance with kWantedDof.
Eigen::Index window_reach(double dof) {
  if (!(dof > 0.0) || dof >= kWantedDof) return 0;  // 0: unknown, considered exact
  const double lines = kWantedDof * variance_of_log_power(std::max(dof, 1.0));
  return static_cast<Eigen::Index>(std::ceil(0.5 * (lines - 1.0)));
}

/// How many of N lines lie within the reach of line k.
Eigen::Index window_lines(Eigen::Index k, Eigen::Index reach, Eigen::Index N) {
  return std::min<Eigen::Index>(N - 1, k + reach) - std::max<Eigen::Index>(0, k - reach) + 1;
}

/// E{g^power} of g, the geometric mean of n sample variances of true value 1 with nu complex degrees
/// of freedom each (Gamma distributed, shape nu, mean 1).
double expected_power(double power, double n, double nu) {
  const double share = power / n;
  if (!(nu + share > 0.0)) return 1.0;  // infinite: a single line with one degree of freedom
  return std::exp(n * (log_gamma(nu + share) - log_gamma(nu) - share * std::log(nu)));
}

/// v^power for power 1 or -1, v the geometric mean over neighbouring lines, which does not spread a resonance of the
/// variance. Its expectation is that power of the true variance. @param own rows to compute
Eigen::MatrixXd smoothed_power(const Eigen::MatrixXd& variance, double dof, double power,
                               DataRange own) {
  const Eigen::Index half = window_reach(dof);
  const double nu = std::max(dof, 1.0);
  const Eigen::Index N = variance.cols();
  Eigen::MatrixXd out(variance.rows(), N);
  if (half == 0) {
    const auto some = variance.middleRows(own.first, own.count);
    const double scale = dof > 0.0 ? (nu - 1.0) / nu : 1.0;
    if (power > 0.0)
      out.middleRows(own.first, own.count) = some;
    else
      out.middleRows(own.first, own.count) = some.cwiseInverse() * scale;
    return out;
  }
  Eigen::VectorXd bias(N);
  for (Eigen::Index k = 0; k < N; ++k)
    bias[k] = std::log(expected_power(power, static_cast<double>(window_lines(k, half, N)), nu));
  const Eigen::Index end = own.first + own.count;
  for (Eigen::Index c = own.first; c < end; c += kTileChannels) {
    const Eigen::Index rows = std::min(kTileChannels, end - c);
    Eigen::MatrixXd logarithm = variance.middleRows(c, rows);
    logarithm = logarithm.array().log().matrix();
    for (Eigen::Index k = 0; k < N; ++k) {
      const auto window =
          logarithm.middleCols(std::max<Eigen::Index>(0, k - half), window_lines(k, half, N));
      out.col(k).segment(c, rows) =
          (power * window.rowwise().mean().array() - bias[k]).exp().matrix();
    }
  }
  return out;
}

/// The unbiased inverse of the smoothed variance.
Eigen::MatrixXd smoothed_inverse(const FrfEstimate& frf, const Eigen::MatrixXd& variance,
                                 double dof) {
  const DataRange own = own_channels(*frf.team, variance.rows());
  if (frf.residual_covariance.size() == 0 || &variance != &frf.noise_variance ||
      window_reach(dof) == 0)
    return smoothed_power(variance, dof, -1.0, own);
  // Var(G_ij) = C_E,ii [(U U^H)^-1]_jj, and only the first factor is random, so only that one is smoothed.
  const Eigen::Index n_y = frf.n_outputs();
  Eigen::MatrixXd C_E(n_y, variance.cols());
  for (Eigen::Index y = 0; y < n_y; ++y)
    C_E.row(y) = frf.residual_covariance.row(y * (n_y + 1)).real();
  if (!(C_E.minCoeff() > 0.0)) return smoothed_power(variance, dof, -1.0, own);
  const Eigen::ArrayXXd ratio = smoothed_power(C_E, dof, -1.0, {0, n_y}).array() * C_E.array();
  return (ratio.replicate(frf.n_inputs(), 1) / variance.array()).matrix();
}

Eigen::MatrixXd inverse_variance(const FrfEstimate& frf, const Eigen::MatrixXd& variance,
                                 double dof, const char* name) {
  if (variance.size() == 0)
    fail_request(
        "weighting {0} needs /{0} in the FRF, which is missing; use relative, or measure more "
        "periods or realizations",
        name);
  const auto [first, count] = own_channels(*frf.team, variance.rows());
  for (Eigen::Index k = 0; k < variance.cols(); ++k)
    for (Eigen::Index c = first; c < first + count; ++c)
      if (!(variance(c, k) > 0.0) || !std::isfinite(variance(c, k)))
        fail_request(
            "{} of {} is zero or not finite; with this weighting every variance must be positive",
            name, channel_name(frf, c, k));
  return smoothed_inverse(frf, variance, dof);
}

Eigen::MatrixXd inverse_magnitude(const FrfEstimate& frf, double exponent) {
  Eigen::MatrixXd W(frf.response.rows(), frf.response.cols());
  const auto [first, count] = frf.own();
  for (Eigen::Index k = 0; k < W.cols(); ++k)
    for (Eigen::Index c = first; c < first + count; ++c) {
      const double magnitude = std::abs(frf.response(c, k));
      if (!(magnitude > 0.0))
        fail_request(
            "response of {} is zero, so its relative error is undefined; exclude the channel or "
            "line, or use weighting unit",
            channel_name(frf, c, k));
      W(c, k) = std::pow(magnitude, -exponent);
      if (!std::isnormal(W(c, k)))
        fail_request(
            "response of {} is {:.2g}: its weight is out of range for double "
            "precision; use units that suit the plant",
            channel_name(frf, c, k), magnitude);
    }
  return W;
}

}  // namespace

// With g the geometric mean of n sample variances of nu degrees of freedom (Gamma distributed) and W
// proportional to 1/g, v one of the n:  E{W^2 v} / (E{W^2} E{v}) = E{v^(1-2/n)} / E{v^(-2/n)} E{v}
//   = 1 - 2 / (n nu).
std::optional<LineVariance> weighed_variance(const FrfEstimate& frf, Weighting weighting) {
  const bool noise = weighting == Weighting::noise_variance;
  const double dof = noise ? frf.noise_dof : frf.total_dof;
  if ((!noise && weighting != Weighting::total_variance) || !(dof > 0.0)) return std::nullopt;
  const Eigen::Index half = window_reach(dof);
  const Eigen::Index N = frf.lines();
  Eigen::ArrayXd divisor(N);
  for (Eigen::Index k = 0; k < N; ++k) {
    const double together = dof * static_cast<double>(window_lines(k, half, N));
    divisor[k] = 1.0 - 2.0 / std::max(together, kLeastTogether);
  }
  return LineVariance{
      SharedMatrix<Eigen::MatrixXd>::kept(noise ? frf.noise_variance : frf.total_variance),
      std::move(divisor)};
}

SmoothedCovariance smoothed_residual_covariance(const FrfEstimate& frf) {
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index N = frf.lines();
  SmoothedCovariance out{frf.residual_covariance, frf.noise_dof};
  if (!(frf.noise_dof > 0.0)) return out;
  // The inverse of an n_y x n_y scatter matrix has the scatter of a variance with n_y degrees of freedom less.
  const double wanted = std::ceil((kWantedDof + static_cast<double>(n_y)) / frf.noise_dof);
  const auto count = static_cast<Eigen::Index>(std::min(wanted, static_cast<double>(N)));
  if (count == 1) return out;
  out.dof = frf.noise_dof * static_cast<double>(count);

  Eigen::MatrixXd variance(n_y, N);
  for (Eigen::Index y = 0; y < n_y; ++y)
    variance.row(y) = frf.residual_covariance.row(y * (n_y + 1)).real();
  const Eigen::MatrixXd deviation =
      smoothed_power(variance, frf.noise_dof, 1.0, {0, n_y}).cwiseSqrt();
  Eigen::MatrixXd products(n_y * n_y, N);  // of the deviations of two outputs
  for (Eigen::Index k = 0; k < N; ++k)
    products.col(k) = (deviation.col(k) * deviation.col(k).transpose()).reshaped();
  const Eigen::MatrixXcd correlation = out.matrices.cwiseQuotient(products);
  for (Eigen::Index k = 0; k < N; ++k) {
    const Eigen::Index first = std::clamp<Eigen::Index>(k - count / 2, 0, N - count);
    out.matrices.col(k) =
        correlation.middleCols(first, count).rowwise().mean().cwiseProduct(products.col(k));
  }
  return out;
}

SharedMatrix<Eigen::MatrixXd> make_weights(const FrfEstimate& frf, const FitOptions& options) {
  if (const auto matrices = make_weight_matrices(frf, options)) return matrices->marginal();
  const auto [first, count] = frf.own();
  switch (options.weighting) {
    case Weighting::unit: {
      Eigen::MatrixXd ones(frf.response.rows(), frf.response.cols());
      ones.middleRows(first, count).setOnes();
      return ones;
    }
    case Weighting::inverse_magnitude:
      return inverse_magnitude(frf, 1.0);
    case Weighting::relative:
      return inverse_magnitude(frf, 2.0);
    case Weighting::noise_variance:
      return inverse_variance(frf, frf.noise_variance, frf.noise_dof, "noise_variance");
    case Weighting::total_variance:
      return inverse_variance(frf, frf.total_variance, frf.total_dof, "total_variance");
    case Weighting::likelihood:
    case Weighting::user:
      break;
  }
  const Eigen::MatrixXd& W = options.user_weights;
  if (W.rows() != frf.response.rows() || W.cols() != frf.response.cols())
    fail_request("user weights: the shape must be that of the response in the band");
  const auto own = W.middleRows(first, count);
  const bool finite = own.allFinite();
  if (finite && (own.array() < 0.0).any())
    throw IndefiniteWeights(
        "user weights: a weight is negative, so the cost would have no minimum");
  if (!finite || !frf.any((own.array() > 0.0).any()))
    fail_request("user weights: all weights must be finite, and at least one positive");
  return options.user_weights;
}

}  // namespace stageid
