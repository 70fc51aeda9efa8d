#include <cmath>
#include <stdexcept>
#include <string>

#include "estimation/fit_problem.hpp"

namespace stageid {
namespace {

/// Degrees of freedom that a variance should have before it weighs: the scatter of the weights then
/// costs 4 % of the efficiency. Smoothing costs more wherever the variance has resonances of its
/// own.
constexpr double kWantedDof = 25.0;

std::string channel_name(const FrfEstimate& frf, Eigen::Index c, Eigen::Index k) {
  return frf.outputs.names[static_cast<std::size_t>(c % frf.n_outputs())] + " <- " +
         frf.inputs.names[static_cast<std::size_t>(c / frf.n_outputs())] + " at " +
         std::to_string(frf.frequency_hz[k]) + " Hz";
}

/// How often the smoothing window holds a line's neighbours on each side.
Eigen::Index window_reach(double dof) {
  return static_cast<Eigen::Index>(
      std::max(0.0, std::ceil(0.5 * (kWantedDof / std::max(dof, 1.0) - 1.0))));
}

/// E{1/variance} of a sample variance with nu complex degrees of freedom is nu/(nu-1) too large.
Eigen::MatrixXd unbiased_inverse(const FrfEstimate& frf, const Eigen::MatrixXd& variance,
                                 double dof) {
  Eigen::MatrixXd inverse = smoothed_variance(frf, variance, dof).cwiseInverse();
  if (!(dof > 0.0)) return inverse;
  const double nu = dof * static_cast<double>(2 * window_reach(dof) + 1);
  return nu > 2.0 ? Eigen::MatrixXd(inverse * ((nu - 1.0) / nu)) : inverse;
}

Eigen::MatrixXd inverse_variance(const FrfEstimate& frf, const Eigen::MatrixXd& variance,
                                 double dof, const char* name) {
  if (variance.size() == 0)
    throw std::invalid_argument(
        std::string("weighting ") + name + " needs /" + name +
        " in the FRF; it has none (use relative, or measure more periods or realizations)");
  for (Eigen::Index k = 0; k < variance.cols(); ++k)
    for (Eigen::Index c = 0; c < variance.rows(); ++c)
      if (!(variance(c, k) > 0.0) || !std::isfinite(variance(c, k)))
        throw std::invalid_argument(
            std::string(name) + " of " + channel_name(frf, c, k) +
            " is zero or not finite; every variance must be positive to weigh with it");
  return unbiased_inverse(frf, variance, dof);
}

Eigen::MatrixXd inverse_magnitude(const FrfEstimate& frf, double exponent) {
  Eigen::MatrixXd W(frf.response.rows(), frf.response.cols());
  for (Eigen::Index k = 0; k < W.cols(); ++k)
    for (Eigen::Index c = 0; c < W.rows(); ++c) {
      const double magnitude = std::abs(frf.response(c, k));
      if (!(magnitude > 0.0))
        throw std::invalid_argument(
            "response of " + channel_name(frf, c, k) +
            " is zero: no relative error exists there; leave the channel or line out, or use "
            "weighting unit");
      W(c, k) = std::pow(magnitude, -exponent);
    }
  return W;
}

}  // namespace

namespace {

/// Geometric mean over neighbouring lines: a resonance that stands out of them does not spread. The
/// bias of the logarithm of a variance (digamma(dof) - log(dof)) is taken back.
Eigen::MatrixXd smoothed(const Eigen::MatrixXd& variance, double dof) {
  const Eigen::Index half = window_reach(dof);
  const Eigen::MatrixXd logarithm = variance.array().log().matrix();
  const Eigen::Index N = variance.cols();
  const double known = std::max(dof, 1.0);
  const double bias = 0.5 / known + 1.0 / (12.0 * known * known);
  Eigen::MatrixXd out(variance.rows(), N);
  for (Eigen::Index k = 0; k < N; ++k) {
    const Eigen::Index first = std::max<Eigen::Index>(0, k - half);
    const Eigen::Index count = std::min<Eigen::Index>(N - 1, k + half) - first + 1;
    out.col(k) =
        (logarithm.middleCols(first, count).rowwise().mean().array() + bias).exp().matrix();
  }
  return out;
}

}  // namespace

Eigen::MatrixXd smoothed_variance(const FrfEstimate& frf, const Eigen::MatrixXd& variance,
                                  double dof) {
  if (!(dof > 0.0) || window_reach(dof) == 0) return variance;  // unknown: taken as exact
  const Eigen::Index n_y = frf.n_outputs();
  if (frf.residual_covariance_re.size() == 0 || &variance != &frf.noise_variance)
    return smoothed(variance, dof);
  // Var(G_ij) = C_E,ii [(U U^H)^-1]_jj, and only the first factor is random: smooth that one.
  Eigen::MatrixXd C_E(n_y, variance.cols());
  for (Eigen::Index y = 0; y < n_y; ++y) C_E.row(y) = frf.residual_covariance_re.row(y * (n_y + 1));
  if (!(C_E.minCoeff() > 0.0)) return smoothed(variance, dof);
  const Eigen::MatrixXd ratio = smoothed(C_E, dof).cwiseQuotient(C_E);
  return variance.cwiseProduct(ratio.replicate(frf.n_inputs(), 1));
}

Eigen::MatrixXd make_weights(const FrfEstimate& frf, const FitOptions& options) {
  switch (options.weighting) {
    case Weighting::unit:
      return Eigen::MatrixXd::Ones(frf.response.rows(), frf.response.cols());
    case Weighting::inverse_magnitude:
      return inverse_magnitude(frf, 1.0);
    case Weighting::relative:
      return inverse_magnitude(frf, 2.0);
    case Weighting::noise_variance:
      return inverse_variance(frf, frf.noise_variance, frf.noise_dof, "noise_variance");
    case Weighting::total_variance:
      return inverse_variance(frf, frf.total_variance, frf.total_dof, "total_variance");
    case Weighting::user:
      break;
  }
  const Eigen::MatrixXd& W = options.user_weights;
  if (W.rows() != frf.response.rows() || W.cols() != frf.response.cols())
    throw std::invalid_argument(
        "user weights: the shape differs from that of the response in the band");
  if (!W.allFinite() || W.minCoeff() < 0.0 || !(W.maxCoeff() > 0.0))
    throw std::invalid_argument(
        "user weights: every weight must be finite and not negative, and one positive");
  return W;
}

}  // namespace stageid
