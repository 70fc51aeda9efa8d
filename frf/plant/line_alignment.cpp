#include "frf/plant/line_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "excitation/threads/worker_pool.hpp"
#include "frf/plant/detection_average.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/statistics/frequency_bands.hpp"

namespace stageid {

AlignmentAverage::AlignmentAverage(std::vector<int> excited, const std::vector<int>& detection,
                                   Eigen::Index outputs)
    : excited_(std::move(excited)), outputs_(outputs) {
  std::vector<int> lines = excited_;
  lines.insert(lines.end(), detection.begin(), detection.end());
  column_ = first_indices(std::ssize(lines));
  const auto line_of = [&](Eigen::Index column) { return lines[column]; };
  std::ranges::sort(column_, {}, line_of);
  std::ranges::transform(column_, std::back_inserter(lines_), line_of);
  const auto L = std::ssize(lines_);
  residuals_.cosine.setZero(outputs, L);
  residuals_.pairs.setZero(outputs, L);
}

void AlignmentAverage::add(const RealizationSpectra& spectra, const Eigen::MatrixXcd& G_before,
                           const Eigen::MatrixXcd& G, int workers) {
  const auto N = std::ssize(excited_);
  const auto L = std::ssize(lines_);
  const Eigen::Index E = spectra.experiments();
  Eigen::MatrixXcd residual = Eigen::MatrixXcd::Zero(outputs_ * E, L);
  for_each_line(workers, L, [&](Eigen::Index l) {
    const Eigen::Index column = column_[l];
    if (column < N && first_) return;
    const Eigen::VectorXcd response = column < N ? Eigen::VectorXcd(G_before.col(column))
                                                 : interpolated_response(excited_, lines_[l], G);
    const Eigen::Map<const Eigen::MatrixXcd> at(response.data(), outputs_,
                                                response.size() / outputs_);
    const Eigen::MatrixXcd Z = spectra.response(column);
    residual.col(l) = (Z.topRows(outputs_) - at * Z.bottomRows(at.cols())).reshaped();
  });
  for (Eigen::Index e = 0; e < E; ++e) {
    const Eigen::MatrixXcd& mean = spectra.runs()[e].mean;
    residuals_.add(
        residual.middleRows(outputs_ * e, outputs_),
        kPowerRounding * mean.topLeftCorner(outputs_, N).cwiseAbs2().rowwise().maxCoeff());
  }
  if (std::exchange(first_, false)) return;
  if (responses_.cosine.size() == 0) {
    responses_.cosine.setZero(G.rows(), N);
    responses_.pairs = responses_.cosine;
  }
  // In proportion to the difference of this realization.
  responses_.add(G - G_before, kPowerRounding * G.cwiseAbs2().rowwise().maxCoeff());
}

LineAlignment AlignmentAverage::of_residuals(double resolution_hz) const {
  LineAlignment found = residuals_;
  found.frequency_hz =
      resolution_hz *
      Eigen::Map<const Eigen::VectorXi>(lines_.data(), std::ssize(lines_)).cast<double>();
  return found;
}

std::optional<PlantChange> find_plant_change(const FrfEstimate& frf,
                                             const Eigen::MatrixXd& cosine) {
  if (cosine.size() == 0 || frf.noise_variance.size() == 0) return std::nullopt;
  std::vector<IndexRange> bands = octave_bands(frf.frequency_hz);
  bands.push_back({0, frf.lines()});
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index n_c = frf.response.rows();
  // Part of the scatter of the realizations that is not noise. It does not depend on the phases.
  const Eigen::ArrayXXd beyond =
      (frf.total_variance.array() > frf.noise_variance.array())
          .select(1.0 - frf.noise_variance.array() / frf.total_variance.array(), 0.0);
  // Entries of G, then the rows of G.
  Eigen::MatrixXd steps = Eigen::MatrixXd::Zero(n_c + n_y, frf.lines());
  for (Eigen::Index k = 1; k < frf.lines(); ++k)
    steps.col(k).head(n_c) = cosine.col(k).array() * beyond.col(k).min(beyond.col(k - 1));
  for (Eigen::Index c = 0; c < n_c; ++c) steps.row(n_c + c % n_y) += steps.row(c);
  const auto tests = static_cast<double>(steps.rows() * std::ssize(bands));
  double least_p = 1.0;
  IndexRange clearest;
  for (const IndexRange& band : bands)
    for (Eigen::Index row = 0; row < steps.rows(); ++row) {
      const auto of_band = steps.row(row).segment(band.first, band.count());
      const double size = of_band.norm();
      const double t = size > 0.0 ? of_band.sum() / size : 0.0;
      const double p = tests * std::exp(-0.5 * std::max(0.0, t) * t);
      if (!(p < least_p)) continue;
      least_p = p;
      clearest = band;
    }
  if (!(least_p < kSignificance)) return std::nullopt;
  const auto mean = [&](const Eigen::MatrixXd& variance) {
    return variance.middleCols(clearest.first, clearest.count()).rowwise().mean().array();
  };
  const double ratio = std::sqrt((mean(frf.total_variance) / mean(frf.noise_variance)).maxCoeff());
  return PlantChange{frf.frequency_hz[clearest.first], frf.frequency_hz[clearest.end - 1], least_p,
                     ratio};
}

}  // namespace stageid
