#include "frf/response/leaked_noise.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "frf/statistics/distributions.hpp"
#include "frf/statistics/frequency_bands.hpp"

namespace stageid {
namespace {

using Eigen::Index;

constexpr Index kFewestRatios = 64;  // lines times inputs: their mean is nearly normal, to a tenth
constexpr double kByChance = 0.01;   // in one of all outputs and bands
constexpr double kFewestDof = 3.0;   // F has a variance
constexpr double kLeast = 1e-3;      // factor; copies of one realization do not scatter at all

/// Mean and variance of F(2 a, 2 b), b > 2.
double mean_of_f(double b) { return b / (b - 1.0); }
double variance_of_f(double a, double b) {
  return mean_of_f(b) * mean_of_f(b) * (a + b - 1.0) / (a * (b - 2.0));
}

/// Multiplies the noise of output i on line k by factor.
void scale(FrfEstimate& frf, Index i, Index k, double factor) {
  const Index n_y = frf.n_outputs();
  const double root = std::sqrt(factor);
  for (Index c = i; c < frf.noise_variance.rows(); c += n_y) frf.noise_variance(c, k) *= factor;
  Eigen::Map<Eigen::MatrixXcd> C(frf.residual_covariance.col(k).data(), n_y, n_y);
  C.row(i) *= root;
  C.col(i) *= root;
  if (frf.covariance.size() == 0) return;
  const Index n_c = frf.response.rows();
  Eigen::Map<Eigen::MatrixXcd> covariance(frf.covariance.col(k).data(), n_c, n_c);
  for (Index c = i; c < n_c; c += n_y) {
    covariance.row(c) *= root;
    covariance.col(c) *= root;
  }
}

/// total / noise of one output on some lines.
struct MeanRatio {
  double mean = 0.0;
  double count = 0.0;  ///< lines and inputs with noise
};

MeanRatio mean_ratio(const RealizationScatter& scatter, Index output, Index outputs,
                     const IndexRange& band) {
  MeanRatio ratio;
  for (Index k = band.first; k < band.end; ++k)
    for (Index c = output; c < scatter.total.rows(); c += outputs) {
      if (!(scatter.noise(c, k) > 0.0)) continue;
      ratio.mean += scatter.total(c, k) / scatter.noise(c, k);
      ratio.count += 1.0;
    }
  if (ratio.count > 0.0) ratio.mean /= ratio.count;
  return ratio;
}

}  // namespace

void lower_leaked_noise(const RealizationScatter& scatter, FrfEstimate& frf) {
  if (scatter.total.size() == 0 || scatter.noise_dof < kFewestDof) return;
  const Index n_y = frf.n_outputs();
  const std::vector<IndexRange> bands =
      octave_bands(frf.frequency_hz, std::max(kFewestLinesOfBand, kFewestRatios / frf.n_inputs()));
  const double expected = mean_of_f(scatter.noise_dof);
  const double variance = variance_of_f(frf.total_dof, scatter.noise_dof);
  const double tests = static_cast<double>(n_y) * static_cast<double>(bands.size());
  for (const IndexRange& band : bands)
    for (Index i = 0; i < n_y; ++i) {
      const MeanRatio ratio = mean_ratio(scatter, i, n_y, band);
      if (ratio.count == 0.0) continue;
      const double below = (expected - ratio.mean) / std::sqrt(variance / ratio.count);
      if (tail_of_normal(below) * tests >= kByChance) continue;
      const double factor = std::max(kLeast, ratio.mean / expected);
      for (Index k = band.first; k < band.end; ++k) scale(frf, i, k, factor);
    }
}

}  // namespace stageid
