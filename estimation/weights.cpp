#include <cmath>
#include <stdexcept>
#include <string>

#include "estimation/fit_problem.hpp"

namespace stageid {
namespace {

/// Degrees of freedom that a smoothed variance should have: its inverse is then biased by 1 %.
constexpr double kWantedDof = 100.0;

std::string channel_name(const FrfEstimate& frf, Eigen::Index c, Eigen::Index k) {
  return frf.outputs.names[static_cast<std::size_t>(c % frf.n_outputs())] + " <- " +
         frf.inputs.names[static_cast<std::size_t>(c / frf.n_outputs())] + " at " +
         std::to_string(frf.frequency_hz[k]) + " Hz";
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
  return smoothed_variance(variance, dof).cwiseInverse();
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

Eigen::MatrixXd smoothed_variance(const Eigen::MatrixXd& variance, double dof) {
  if (!(dof > 0.0)) return variance;  // unknown: taken as exact
  const double known = std::max(dof, 1.0);
  const auto half = static_cast<Eigen::Index>(std::ceil(0.5 * (kWantedDof / known - 1.0)));
  if (half <= 0) return variance;
  // Geometric mean: a resonance that stands out of its neighbours does not spread, and the bias of
  // the logarithm of a variance (digamma(dof) - log(dof), about -1/(2 dof)) is taken back.
  const Eigen::MatrixXd logarithm = variance.array().log().matrix();
  const Eigen::Index N = variance.cols();
  Eigen::MatrixXd out(variance.rows(), N);
  for (Eigen::Index k = 0; k < N; ++k) {
    const Eigen::Index reach = std::min({half, k, N - 1 - k});
    const double bias = 0.5 / known + 1.0 / (12.0 * known * known);
    out.col(k) = (logarithm.middleCols(k - reach, 2 * reach + 1).rowwise().mean().array() + bias)
                     .exp()
                     .matrix();
  }
  return out;
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
