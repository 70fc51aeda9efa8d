#include "frf/plant/response_drift.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

#include "excitation/decompositions/decompositions.hpp"
#include "frf/statistics/frequency_bands.hpp"

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
  bool poles = false;     // whether X may follow from a pole
  double span = 0.0;      // duration of the measurement in its unit of time
  double reported = 0.0;  // duration of the change that is reported
  bool within_runs = false;
};

/// X = -f dG/df from the neighbours of each line of the window.
MatrixXcd by_differences(const FrfEstimate& frf, Index first) {
  MatrixXcd X(frf.response.rows(), kWindow);
  for (Index i = 0; i < kWindow; ++i) {
    const Index k = first + i;
    const double apart_hz = frf.frequency_hz[k + 1] - frf.frequency_hz[k - 1];
    X.col(i) =
        (frf.response.col(k + 1) - frf.response.col(k - 1)) * (-frf.frequency_hz[k] / apart_hz);
  }
  return X;
}

/// The same if the resonance is narrower than a few lines: G = N / (r - p) with N quadratic in the line r and a pole p
/// common to the channels, X = f N(p) / (r - p)^2. Least squares of (r - p) G - N over all channels, relative to the
/// noise. Empty without a pole in the window.
MatrixXcd by_pole(const FrfEstimate& frf, Index first, const Eigen::ArrayXd& noise) {
  const double middle_hz = frf.frequency_hz[first + kWindow / 2];
  const VectorXd away_hz = frf.frequency_hz.segment(first, kWindow).array() - middle_hz;
  const double reach_hz = away_hz.cwiseAbs().maxCoeff();
  const Eigen::ArrayXd r = away_hz.array() / reach_hz;
  const MatrixXcd G = frf.response.middleCols(first, kWindow).transpose() *
                      noise.rsqrt().matrix().cast<std::complex<double>>().asDiagonal();
  std::complex<double> pole = 0.0;
  MatrixXcd N;  // coefficients x channels
  VectorXd weight = VectorXd::Ones(kWindow);
  for (int pass = 0; pass < 3; ++pass) {  // Sanathanan and Koerner's weights
    MatrixXd powers(kWindow, 3);
    powers << weight, weight.array() * r, weight.array() * r * r;
    const MatrixXd Q = leading_columns(pivoted_qr(powers), 3);
    const auto rest = [&](const MatrixXcd& columns) {
      return MatrixXcd(columns - Q * (Q.transpose() * columns));
    };
    const MatrixXcd A = rest(weight.asDiagonal() * G);
    const MatrixXcd B = rest((weight.array() * r).matrix().asDiagonal() * G);
    const double length = A.squaredNorm();
    if (!(length > 0.0)) return {};
    pole = A.conjugate().cwiseProduct(B).sum() / length;
    weight = (r - pole).abs().max(1e-6).inverse();
    const MatrixXcd left = (r - pole).matrix().asDiagonal() * G;
    MatrixXcd plain(kWindow, 3);
    plain.col(0).setOnes();
    plain.col(1) = r.matrix().cast<std::complex<double>>();
    plain.col(2) = r.square().matrix().cast<std::complex<double>>();
    const MatrixXcd W = weight.cast<std::complex<double>>().asDiagonal() * plain;
    N = solve(W.adjoint() * W, W.adjoint() * (weight.asDiagonal() * left));
  }
  if (std::abs(pole.real()) > 1.0 || std::abs(pole.imag()) > 1.0) return {};
  const Eigen::RowVectorXcd at_pole = N.row(0) + pole * N.row(1) + pole * pole * N.row(2);
  const Eigen::ArrayXcd shape =
      (r - pole).square().inverse() * (middle_hz / reach_hz + pole.real());
  return noise.sqrt().matrix().asDiagonal() * at_pole.transpose() * shape.matrix().transpose();
}

/// Least squares of one slope in one window.
struct WindowFit {
  double along = 0.0;     ///< Re X^H V^-1 D
  double length = 0.0;    ///< X^H V^-1 X
  double variance = 0.0;  ///< of `along`
  double bias = 0.0;      ///< largest |X| over a deviation of the response
  double explained() const { return length > 0.0 ? along * along / length : 0.0; }
};

/// Least squares of one slope, in windows.
class DriftFit {
 public:
  DriftFit(const FrfEstimate& frf, const Slope& slope) : frf_(frf), slope_(slope) {
    const Index K = frf.lines();
    power_.setZero(K);
    expected_.setZero(K);
    change_.setZero(K);
    for (Index k = 1; k + 1 < K; ++k) {
      const Eigen::ArrayXd variance = slope_.variance * noise_about(k);
      power_[k] = (slope_.values.col(k).array().abs2() / variance).sum();
      expected_[k] = slope_.variance * (frf.noise_variance.col(k).array() / variance).sum();
      change_[k] = slope_.values.col(k).norm();
    }
  }

  /// Finds the line with the largest change in windows with a drift; the drift is that of the window around it. The
  /// most significant line is unsuitable: the scatter over the periods contains the drift, largest at its maximum.
  std::optional<ModeDrift> find() const {
    const Index K = frf_.lines();
    std::vector<Index> drifting;  // middles of windows
    VectorXd covered = VectorXd::Zero(K);
    for (Index first = 1; first + kWindow < K; ++first) {
      // Without this excess, no direction can explain as much as 8 standard deviations.
      if (!(excess(first) > 0.5 * kDriftDeviations * kDriftDeviations) ||
          !drifts(fit(first), first))
        continue;
      drifting.push_back(first + kWindow / 2);
      // A poorly resolved resonance does not fit its derivative, but its flanks do.
      const Index from = std::max<Index>(1, first - kWindow);
      covered.segment(from, std::min(K, first + 2 * kWindow) - from).setOnes();
    }
    if (drifting.empty()) return std::nullopt;
    Index most = 0;
    covered.cwiseProduct(change_).maxCoeff(&most);
    const Index middle =
        std::ranges::min(drifting, {}, [most](Index a) { return std::abs(a - most); });
    const Index first = middle - kWindow / 2;
    const WindowFit window = fit(first);
    // What the drift leaves unexplained is an error of X, and makes the drift as uncertain as noise of that size.
    const double expected = expected_.segment(first, kWindow).sum();
    const double rest = power_.segment(first, kWindow).sum() - window.explained();
    const double larger = std::sqrt(std::max(1.0, rest / expected));
    ModeDrift drift;
    drift.frequency_hz = frf_.frequency_hz[most];
    const double rate = window.along / window.length;
    drift.change = rate * slope_.reported;
    drift.deviation = larger * std::sqrt(window.variance) / window.length * slope_.reported;
    drift.bias = 0.5 * std::abs(rate * slope_.span) * window.bias;
    drift.within_runs = slope_.within_runs;
    drift.in_total = frf_.realizations > 1;
    if (!(drift.bias > kLeastBias)) return std::nullopt;
    return drift;
  }

 private:
  double least(Index k) const {
    return kDriftRounding * frf_.response.col(k).cwiseAbs2().maxCoeff() + 1e-300;
  }
  Eigen::ArrayXd noise_about(Index k) const {
    return mean_around(frf_.noise_variance, k, kWindow / 2).array() + least(k);
  }

  /// Power of the slope beyond noise.
  double excess(Index first) const {
    return power_.segment(first, kWindow).sum() - expected_.segment(first, kWindow).sum();
  }

  bool drifts(const WindowFit& window, Index first) const {
    return std::abs(window.along) > kDriftDeviations * std::sqrt(window.variance) &&
           window.explained() >= slope_.least_share * excess(first);
  }

  /// With that X which explains more.
  WindowFit fit(Index first) const {
    const WindowFit one = fit(first, by_differences(frf_, first));
    if (!slope_.poles) return one;
    const MatrixXcd X = by_pole(frf_, first, noise_about(first + kWindow / 2));
    if (X.size() == 0) return one;
    const WindowFit other = fit(first, X);
    return other.explained() > one.explained() ? other : one;
  }

  WindowFit fit(Index first, const MatrixXcd& X) const {
    const Index n_y = frf_.n_outputs();
    const Index n_u = frf_.n_inputs();
    WindowFit window;
    for (Index i = 0; i < kWindow; ++i) {
      const Index k = first + i;
      const Eigen::ArrayXd noise = noise_about(k);
      const Eigen::ArrayXd variance = slope_.variance * noise;
      const Eigen::VectorXcd weighted = X.col(i).array() / variance;
      window.along += weighted.dot(slope_.values.col(k)).real();
      window.length += (X.col(i).array().abs2() / variance).sum();
      window.bias = std::max(window.bias, (X.col(i).array().abs() / noise.sqrt()).maxCoeff());
      const Eigen::Map<const MatrixXcd> W(weighted.data(), n_y, n_u);
      const MatrixXcd S = frf_.input_factor.col(k).reshaped(n_u, n_u);
      const MatrixXcd of_inputs = W.adjoint() * output_covariance(frf_, k) * W;
      // At least the rounding errors.
      window.variance += 0.5 * slope_.variance *
                         (S.cwiseProduct(of_inputs).sum().real() + least(k) * W.squaredNorm());
    }
    return window;
  }

  const FrfEstimate& frf_;
  const Slope& slope_;
  VectorXd power_;     // D^H V^-1 D, by line
  VectorXd expected_;  // the same of noise
  VectorXd change_;    // |D|
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
  MatrixXcd slope(spectra.runs().front().mean.rows(), E);
  double variance = 0.0;
  Index e = 0;
  for (const RunSpectra& run : spectra.runs()) {
    if (run.slope.size() == 0) {
      variance_sum_[k] = std::numeric_limits<double>::infinity();
      return;
    }
    slope.col(e++) = run.slope.col(k);
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
      frf.residual_covariance.size() == 0 || frf.lines() < kWindow + 2)
    return std::nullopt;
  const double M = frf.realizations;
  // The slope over the realizations is more accurate.
  if (frf.realizations > 1) {
    const Slope slope{(counted_sum_ - M * (M - 1.0) / 2.0 * G_mean) * (12.0 / (M * (M * M - 1.0))),
                      12.0 / (M * M - 1.0),
                      kLeastShareOfRealizations,
                      true,
                      M,
                      M - 1.0};
    if (auto drift = DriftFit(frf, slope).find()) return drift;
  }
  if (!std::isfinite(variance_sum_.sum())) return std::nullopt;
  const Slope slope{slope_sum_ / M,
                    variance_sum_[0] / M,
                    kLeastShare,
                    false,
                    M * frf.experiments * run_periods,
                    static_cast<double>(run_periods),
                    true};
  return DriftFit(frf, slope).find();
}

Finding to_finding(const ModeDrift& drift) {
  return {
      drift.bias > kMisleading ? Severity::fault : Severity::doubt,
      Cause::drift,
      "",
      fmt::format("the response changes during the measurement: near {:.4g} Hz a mode moves by "
                  "{:+.2g} % {}{}",
                  drift.frequency_hz, 100.0 * drift.change,
                  drift.within_runs ? "within each run" : "from the first realization to the last",
                  drift.in_total ? "" : "; the standard deviations do not include it"),
      fmt::format(
          "{:+.2g} +- {:.1g} %; the error of the response is up to {:.2g} standard deviations",
          100.0 * drift.change, 100.0 * drift.deviation, drift.bias),
      fmt::format("let the stage warm up, or measure for a shorter time; {}the total variance "
                  "includes the drift",
                  drift.in_total ? "" : "with several realizations ")};
}

}  // namespace stageid
