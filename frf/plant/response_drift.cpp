#include "frf/plant/response_drift.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kWindow = 9;
constexpr double kDriftDeviations = 8.0;
constexpr double kLeastShare = 0.5;
// Distortions differ between realizations, on as few lines as a resonance has. Five complex numbers of equal size
// have this share along one direction by chance once in several thousand cases.
constexpr double kLeastShareOfRealizations = 0.8;
constexpr double kLeastBias = 1.0;
constexpr double kDriftRounding = 1e-16;  // of the largest |G|^2 of a line

/// A slope of G in time, and its variance per unit of noise_variance.
struct Slope {
  MatrixXcd values;  // vec(G) x lines
  double variance = 0.0;
  double least_share = kLeastShare;
  double span = 0.0;  // duration of the measurement in its unit of time
};

/// Mean over the lines of the window around line k, truncated at the ends.
VectorXd about(const MatrixXd& columns, Index k) {
  const Index first = std::max<Index>(0, k - kWindow / 2);
  const Index last = std::min(columns.cols(), k + kWindow / 2 + 1);
  return columns.middleCols(first, last - first).rowwise().mean();
}

/// X = -f dG/df from the neighbours of line k.
Eigen::VectorXcd derivative(const FrfEstimate& frf, Index k) {
  const double apart_hz = frf.frequency_hz[k + 1] - frf.frequency_hz[k - 1];
  return (frf.response.col(k + 1) - frf.response.col(k - 1)) * (-frf.frequency_hz[k] / apart_hz);
}

/// Least squares of one slope, in windows.
class DriftFit {
 public:
  DriftFit(const FrfEstimate& frf, const Slope& slope) : frf_(frf), slope_(slope) {
    const Index K = frf.lines();
    along_.setZero(K);
    length_.setZero(K);
    variance_.setZero(K);
    excess_.setZero(K);
    bias_.setZero(K);
    change_.setZero(K);
    for (Index k = 1; k + 1 < K; ++k) add_line(k);
  }

  /// Finds the line with the largest change in windows with a drift; the drift is that of the window around it. The
  /// most significant line is unsuitable: the scatter over the periods contains the drift, largest at its maximum.
  std::optional<ModeDrift> find() const {
    const Index K = frf_.lines();
    std::vector<Index> drifting;  // middles of windows
    VectorXd covered = VectorXd::Zero(K);
    for (Index first = 1; first + kWindow < K; ++first) {
      if (!drifts(first)) continue;
      drifting.push_back(first + kWindow / 2);
      // A poorly resolved resonance does not fit its derivative, but its flanks do.
      const Index from = std::max<Index>(1, first - kWindow);
      covered.segment(from, std::min(K, first + 2 * kWindow) - from).setOnes();
    }
    if (drifting.empty()) return std::nullopt;
    Index most = 0;
    covered.cwiseProduct(change_).maxCoeff(&most);
    const Index middle = *std::min_element(
        drifting.begin(), drifting.end(),
        [most](Index a, Index b) { return std::abs(a - most) < std::abs(b - most); });
    const Index first = middle - kWindow / 2;
    const double length = length_.segment(first, kWindow).sum();
    ModeDrift drift;
    drift.frequency_hz = frf_.frequency_hz[most];
    drift.change = along_.segment(first, kWindow).sum() / length * slope_.span;
    drift.deviation = std::sqrt(variance_.segment(first, kWindow).sum()) / length * slope_.span;
    drift.bias = 0.5 * std::abs(drift.change) * bias_.segment(first, kWindow).maxCoeff();
    drift.in_total = frf_.realizations > 1;
    if (!(drift.bias > kLeastBias)) return std::nullopt;
    return drift;
  }

 private:
  bool drifts(Index first) const {
    const double along = along_.segment(first, kWindow).sum();
    const double length = length_.segment(first, kWindow).sum();
    const double deviation = std::sqrt(variance_.segment(first, kWindow).sum());
    if (!(length > 0.0) || !(std::abs(along) > kDriftDeviations * deviation)) return false;
    const double excess = excess_.segment(first, kWindow).sum();
    return along * along / length >= slope_.least_share * excess;
  }

  void add_line(Index k) {
    const Index n_y = frf_.n_outputs();
    const Index n_u = frf_.n_inputs();
    const Eigen::VectorXcd X = derivative(frf_, k);
    const Eigen::VectorXcd D = slope_.values.col(k);
    const double least = kDriftRounding * frf_.response.col(k).cwiseAbs2().maxCoeff() + 1e-300;
    const Eigen::ArrayXd noise = about(frf_.noise_variance, k).array() + least;
    const Eigen::ArrayXd variance = slope_.variance * noise;
    const Eigen::VectorXcd weighted = X.array() / variance;
    along_[k] = weighted.dot(D).real();
    length_[k] = (X.array().abs2() / variance).sum();
    excess_[k] = (D.array().abs2() / variance).sum() -
                 slope_.variance * (frf_.noise_variance.col(k).array() / variance).sum();
    change_[k] = D.norm();
    bias_[k] = (X.array().abs() / noise.sqrt()).maxCoeff();
    const Eigen::Map<const MatrixXcd> W(weighted.data(), n_y, n_u);
    const MatrixXcd S = frf_.input_factor.col(k).reshaped(n_u, n_u);
    const MatrixXcd of_inputs = W.adjoint() * output_covariance(frf_, k) * W;
    // At least the rounding errors.
    variance_[k] =
        0.5 * slope_.variance * (S.cwiseProduct(of_inputs).sum().real() + least * W.squaredNorm());
  }

  const FrfEstimate& frf_;
  const Slope& slope_;
  VectorXd along_;     // Re X^H V^-1 D, by line
  VectorXd length_;    // X^H V^-1 X
  VectorXd variance_;  // of along_
  VectorXd excess_;    // D^H V^-1 D beyond noise
  VectorXd change_;    // |D|
  VectorXd bias_;      // largest |X| over a deviation of the response
};

}  // namespace

ResponseDrift::ResponseDrift(Index outputs, Index inputs, Index lines) : outputs_(outputs) {
  slope_sum_.setZero(outputs * inputs, lines);
  counted_sum_.setZero(outputs * inputs, lines);
  variance_sum_.setZero(lines);
}

void ResponseDrift::add(const RealizationSpectra& spectra, const LineEstimate& line, int count,
                        Index k) {
  counted_sum_.col(k) += static_cast<double>(count) * line.G.reshaped();
  const Index E = spectra.experiments();
  MatrixXcd slope(spectra.run(0).mean.rows(), E);
  double variance = 0.0;
  for (Index e = 0; e < E; ++e) {
    const RunSpectra& run = spectra.run(static_cast<std::size_t>(e));
    if (run.slope.size() == 0) {
      variance_sum_[k] = std::numeric_limits<double>::infinity();
      return;
    }
    slope.col(e) = run.slope.col(k);
    variance += run.periods / run.slope_spread / static_cast<double>(E);
  }
  const MatrixXcd D =
      (slope.topRows(outputs_) - line.G * slope.bottomRows(slope.rows() - outputs_)) * line.Q;
  slope_sum_.col(k) += D.reshaped();
  variance_sum_[k] += variance;
}

std::optional<ModeDrift> ResponseDrift::find(const FrfEstimate& frf, const MatrixXcd& G_mean,
                                             int run_periods) const {
  if (frf.noise_variance.size() == 0 || frf.input_factor.size() == 0 ||
      frf.residual_covariance_re.size() == 0 || frf.lines() < kWindow + 2)
    return std::nullopt;
  const double M = frf.realizations;
  // The slope over the realizations is more accurate.
  if (frf.realizations > 1) {
    const Slope slope{(counted_sum_ - M * (M - 1.0) / 2.0 * G_mean) * (12.0 / (M * (M * M - 1.0))),
                      12.0 / (M * M - 1.0), kLeastShareOfRealizations, M};
    if (auto drift = DriftFit(frf, slope).find()) return drift;
  }
  if (!std::isfinite(variance_sum_.sum())) return std::nullopt;
  const Slope slope{slope_sum_ / M, variance_sum_[0] / M, kLeastShare,
                    M * frf.experiments * run_periods};
  return DriftFit(frf, slope).find();
}

Finding to_finding(const ModeDrift& drift) {
  Finding finding;
  finding.severity = Severity::doubt;
  finding.cause = Cause::drift;
  finding.what = fmt::format(
      "the response changes during the measurement: near {:.4g} Hz a mode moves by {:+.2g} % from "
      "the "
      "first run to the last{}",
      drift.frequency_hz, 100.0 * drift.change,
      drift.in_total ? "" : "; the standard deviations do not include it");
  finding.figure = fmt::format(
      "{:+.2g} +- {:.1g} %; the error of the response is up to {:.2g} standard deviations",
      100.0 * drift.change, 100.0 * drift.deviation, drift.bias);
  finding.remedy = drift.in_total ? "let the stage warm up, or measure for a shorter time; the "
                                    "total variance includes the drift"
                                  : "let the stage warm up, or measure for a shorter time; with "
                                    "several realizations the total variance includes the drift";
  return finding;
}

}  // namespace stageid
