#include "estimation/model/cmif.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "acquisition/files/fail.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/threads/worker_pool.hpp"
#include "frf/response/dc_line.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

/// Factor of every element of the matrix whose singular values are computed, on line k, n_y x n_u.
Eigen::MatrixXd element_weights(const FrfEstimate& frf, CmifKind kind, Eigen::Index k) {
  Eigen::MatrixXd weights = Eigen::MatrixXd::Ones(frf.n_outputs(), frf.n_inputs());
  if (kind == CmifKind::accelerance) {
    const double omega = 2.0 * std::numbers::pi * frf.frequency_hz[k];
    weights *= omega * omega;
  } else if (kind == CmifKind::whitened) {
    const Eigen::MatrixXd& noise =
        frf.noise_variance.size() > 0 ? frf.noise_variance : frf.total_variance;
    if (noise.size() == 0)
      fail_request("CMIF: whitening needs variances, but the FRF has none; use accelerance");
    weights.reshaped() = noise.col(k).cwiseSqrt().cwiseInverse();
  }
  return weights;
}

/// G(j omega_k) times these factors.
Eigen::MatrixXcd weighted_response(const FrfEstimate& frf, CmifKind kind, Eigen::Index k) {
  return frf.at(k).cwiseProduct(element_weights(frf, kind, k).cast<std::complex<double>>());
}

/// Transposed if needed so that rows <= columns.
Eigen::MatrixXcd wide_response(const FrfEstimate& frf, CmifKind kind, Eigen::Index k) {
  Eigen::MatrixXcd G = weighted_response(frf, kind, k);
  if (G.rows() > G.cols()) G.transposeInPlace();
  return G;
}

/// Left singular vectors of one line; those of all lines would need as much memory as the response.
Eigen::MatrixXcd shapes(const FrfEstimate& frf, CmifKind kind, Eigen::Index k) {
  return svd(wide_response(frf, kind, k), Eigen::ComputeThinU).matrixU();
}

/// Height of a peak above the higher of the two valleys around it, in dB of power.
double prominence_db(const Eigen::Ref<const Eigen::RowVectorXd>& curve, Eigen::Index peak) {
  const double height = curve[peak];
  double left = height;
  for (Eigen::Index k = peak - 1; k >= 0 && curve[k] <= height; --k)
    left = std::min(left, curve[k]);
  double right = height;
  for (Eigen::Index k = peak + 1; k < curve.size() && curve[k] <= height; ++k)
    right = std::min(right, curve[k]);
  return 10.0 * std::log10(height / std::max({left, right, 1e-300}));
}

/// Half-power width by linear interpolation; if one side is not clean, twice the narrower side.
double half_power_damping(const Eigen::VectorXd& f,
                          const Eigen::Ref<const Eigen::RowVectorXd>& curve, Eigen::Index peak) {
  const double half = 0.5 * curve[peak];
  const auto side = [&](Eigen::Index direction) {
    Eigen::Index k = peak;
    while (k + direction >= 0 && k + direction < curve.size() && curve[k + direction] < curve[k]) {
      const Eigen::Index next = k + direction;
      if (curve[next] <= half) {
        const double share = (curve[k] - half) / (curve[k] - curve[next]);
        return std::abs(f[k] + share * (f[next] - f[k]) - f[peak]);
      }
      k = next;
    }
    return 0.0;
  };
  const double below = side(-1);
  const double above = side(+1);
  const double width = below > 0.0 && above > 0.0 ? below + above : 2.0 * std::max(below, above);
  if (!(width > 0.0)) return 0.01;
  return std::clamp(width / (2.0 * f[peak]), 5e-4, 0.1);
}

/// Whether a peak of a lower curve only mirrors a crossing: the curve above has a dip there and the shapes are
/// exchanged.
bool is_crossing(const FrfEstimate& frf, CmifKind kind, const Eigen::MatrixXd& curves,
                 Eigen::Index curve, Eigen::Index k) {
  if (curve == 0 || k == 0 || k + 1 >= curves.cols()) return false;
  const double gap_db =
      10.0 * std::log10(curves(curve - 1, k) / std::max(curves(curve, k), 1e-300));
  if (gap_db > 3.0) return false;
  const Eigen::MatrixXcd before = shapes(frf, kind, k - 1);
  const Eigen::MatrixXcd after = shapes(frf, kind, k + 1);
  const auto mac = [&](Eigen::Index i, Eigen::Index j) {
    return std::norm(before.col(i).dot(after.col(j)));
  };
  return mac(curve, curve - 1) > 0.5 && mac(curve - 1, curve) > 0.5;
}

constexpr double kScatterFactor = 5.0;  // peaks of pure noise in thousands of lines remain below

/// Scatter of the curve around a line in dB (standard deviation of its logarithm), from second differences, which
/// exclude slopes and the tops of smooth peaks.
double scatter_db(const Eigen::RowVectorXd& curve_db, Eigen::Index line) {
  constexpr Eigen::Index kReach = 24;
  const Eigen::Index first = std::max<Eigen::Index>(1, line - kReach);
  const Eigen::Index last = std::min<Eigen::Index>(curve_db.size() - 2, line + kReach);
  std::vector<double> bends;
  for (Eigen::Index i = first; i <= last; ++i)
    bends.push_back(std::abs(curve_db[i - 1] - 2.0 * curve_db[i] + curve_db[i + 1]));
  return order_statistic(bends, 0.5) / (0.6745 * std::sqrt(6.0));  // scale for normal numbers
}

/// Lower quartile of the lines beside a peak, up to where the curve exceeds the peak again: a base that does not
/// depend on the deepest dips of the noise.
double base_db(const Eigen::RowVectorXd& curve_db, Eigen::Index peak, Eigen::Index direction) {
  std::vector<double> values;
  for (Eigen::Index k = peak + direction;
       k >= 0 && k < curve_db.size() && curve_db[k] <= curve_db[peak]; k += direction)
    values.push_back(curve_db[k]);
  if (values.empty()) return curve_db[peak];
  return order_statistic(values, 0.25);
}

/// Whether a local maximum exceeds its surroundings by more than the maxima of noise do.
bool above_scatter(const Eigen::RowVectorXd& curve_db, Eigen::Index peak) {
  const double base = std::max(base_db(curve_db, peak, -1), base_db(curve_db, peak, +1));
  return curve_db[peak] - base > kScatterFactor * scatter_db(curve_db, peak);
}

}  // namespace

Eigen::MatrixXd cmif(const FrfEstimate& frf, CmifKind kind) {
  Eigen::MatrixXd curves(std::min(frf.n_outputs(), frf.n_inputs()), frf.lines());
  for_each_line(worker_count(0), frf.lines(), [&](Eigen::Index k) {
    curves.col(k) =
        svd(wide_response(frf, kind, k), 0).singularValues().head(curves.rows()).cwiseAbs2();
  });
  return curves;
}

Eigen::MatrixXd cmif_deviation(const FrfEstimate& frf, CmifKind kind,
                               const Eigen::MatrixXd& variance) {
  if (variance.rows() != frf.response.rows() || variance.cols() != frf.response.cols())
    fail_request("CMIF: the variance must have the shape of the response");
  const Eigen::Index curves = std::min(frf.n_outputs(), frf.n_inputs());
  Eigen::MatrixXd deviation(curves, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXd weights = element_weights(frf, kind, k);
    const Eigen::MatrixXcd G = weighted_response(frf, kind, k);
    const Eigen::Map<const Eigen::MatrixXd> raw(variance.col(k).data(), G.rows(), G.cols());
    const Eigen::MatrixXd V = raw.cwiseProduct(weights.cwiseAbs2());
    const auto parts = svd(G, Eigen::ComputeThinU | Eigen::ComputeThinV);
    for (Eigen::Index i = 0; i < curves; ++i) {
      const double s = parts.singularValues()[i];
      const double spread =
          parts.matrixU().col(i).cwiseAbs2().dot(V * parts.matrixV().col(i).cwiseAbs2());
      deviation(i, k) = std::sqrt(2.0 * s * s * spread);
    }
  }
  return deviation;
}

std::vector<ModeCandidate> pick_modes(const FrfEstimate& frf, const PeakOptions& options) {
  if (has_dc_line(frf)) return pick_modes(without_dc_line(frf), options);
  const Eigen::MatrixXd curves = cmif(frf, options.kind);
  struct Peak {
    ModeCandidate mode;
    double prominence;
  };
  std::vector<Peak> peaks;
  for (Eigen::Index c = 0; c < curves.rows(); ++c) {
    const Eigen::RowVectorXd curve = curves.row(c);
    const Eigen::RowVectorXd curve_db = 10.0 * curve.array().max(1e-300).log10();
    for (Eigen::Index k = 1; k + 1 < curve.size(); ++k) {
      if (!(curve[k] > curve[k - 1] && curve[k] >= curve[k + 1])) continue;
      const double prominence = prominence_db(curve, k);
      if (prominence < options.minimum_prominence_db || !above_scatter(curve_db, k) ||
          is_crossing(frf, options.kind, curves, c, k))
        continue;
      peaks.push_back({{frf.frequency_hz[k], half_power_damping(frf.frequency_hz, curve, k),
                        static_cast<int>(c) + 1},
                       prominence});
    }
  }
  std::ranges::stable_sort(peaks, std::greater<>(), &Peak::prominence);
  if (peaks.size() > static_cast<std::size_t>(options.most_peaks)) peaks.resize(options.most_peaks);
  std::vector<ModeCandidate> modes;
  for (const Peak& peak : peaks) modes.push_back(peak.mode);
  std::ranges::stable_sort(modes, {}, &ModeCandidate::frequency_hz);
  return modes;
}

}  // namespace stageid
