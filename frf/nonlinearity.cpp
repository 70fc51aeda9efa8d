#include "frf/nonlinearity.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace stageid {
namespace {

constexpr Eigen::Index kFewestLines = 8;

/// ln P(F > x) for F(2 a, 2 b), a whole: with w = b / (b + a x) that is the incomplete beta function
///   I_w(b, a) = w^b sum_{j < a} Gamma(b + j) / (Gamma(b) j!) (1 - w)^j.
double log_tail_of_f(double x, int a, double b) {
  const double rest = a * x / (b + a * x);  // 1 - w
  double term = 1.0;
  double sum = 1.0;
  for (int j = 1; j < a; ++j) {
    term *= (b + j - 1.0) / j * rest;
    sum += term;
  }
  return std::min(0.0, b * std::log1p(-rest) + std::log(sum));
}

/// P(chi-square with 2 K degrees of freedom > 2 h) = exp(-h) sum_{j < K} h^j / j!.
double tail_of_chi_square(double h, Eigen::Index K) {
  if (!(h > 0.0)) return 1.0;
  double sum = 0.0;
  for (Eigen::Index j = 0; j < K; ++j) {
    const double n = static_cast<double>(j);
    sum += std::exp(n * std::log(h) - std::lgamma(n + 1.0) - h);
  }
  return std::min(1.0, sum);
}

/// First line of each band, and the number of lines at the end.
std::vector<Eigen::Index> band_limits(const Eigen::VectorXd& frequency_hz) {
  std::vector<Eigen::Index> limits = {0};
  double first_hz = frequency_hz[0];
  for (Eigen::Index k = 1; k < frequency_hz.size(); ++k) {
    if (frequency_hz[k] < 2.0 * first_hz || k - limits.back() < kFewestLines) continue;
    limits.push_back(k);
    first_hz = frequency_hz[k];
  }
  // What is left over belongs to the band before it.
  if (limits.size() > 1 && frequency_hz.size() - limits.back() < kFewestLines) limits.pop_back();
  limits.push_back(frequency_hz.size());
  return limits;
}

void require_variances(const FrfEstimate& frf) {
  if (frf.noise_variance.size() == 0 || !(frf.noise_dof > 0.0)) {
    throw std::invalid_argument(
        "nonlinearity test: the noise variance or its noise_dof is unknown; measure two periods");
  }
  if (frf.total_variance.size() == 0 || !(frf.total_dof >= 1.0) ||
      frf.total_dof != std::floor(frf.total_dof)) {
    throw std::invalid_argument(
        "nonlinearity test: the total variance or its total_dof, realizations - 1, is unknown; "
        "measure two realizations");
  }
}

}  // namespace

NonlinearityTest nonlinearity_test(const FrfEstimate& frf) {
  require_variances(frf);
  const std::vector<Eigen::Index> limits = band_limits(frf.frequency_hz);
  const auto bands = static_cast<Eigen::Index>(limits.size()) - 1;
  const Eigen::Index n_c = frf.response.rows();
  const int a = static_cast<int>(frf.total_dof);
  NonlinearityTest test{Eigen::MatrixXd(bands, 2), Eigen::MatrixXd(n_c, bands),
                        Eigen::MatrixXd(n_c, bands)};
  for (Eigen::Index b = 0; b < bands; ++b) {
    const Eigen::Index first = limits[static_cast<std::size_t>(b)];
    const Eigen::Index K = limits[static_cast<std::size_t>(b) + 1] - first;
    test.band_hz.row(b) << frf.frequency_hz[first], frf.frequency_hz[first + K - 1];
    for (Eigen::Index c = 0; c < n_c; ++c) {
      double evidence = 0.0;  // -sum ln p
      double excess = 0.0;
      for (Eigen::Index k = first; k < first + K; ++k) {
        const double total = frf.total_variance(c, k);
        const double noise = frf.noise_variance(c, k);
        // Without any noise every scatter is certain; without either there is nothing to see.
        if (noise > 0.0) evidence -= log_tail_of_f(total / noise, a, frf.noise_dof);
        if (noise == 0.0 && total > 0.0) evidence += 1e3;
        excess += std::max(0.0, total - noise);
      }
      test.p_value(c, b) = tail_of_chi_square(evidence, K);
      test.distortion(c, b) =
          std::sqrt((a + 1) * excess / frf.response.row(c).segment(first, K).squaredNorm());
    }
  }
  return test;
}

}  // namespace stageid
