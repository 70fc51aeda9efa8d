#include "frf/plant/line_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "excitation/threads/worker_pool.hpp"
#include "frf/plant/detection_average.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {

AlignmentAverage::AlignmentAverage(std::vector<int> excited, const std::vector<int>& detection,
                                   Eigen::Index outputs)
    : excited_(std::move(excited)), outputs_(outputs) {
  std::vector<int> lines = excited_;
  lines.insert(lines.end(), detection.begin(), detection.end());
  column_ = first_indices(std::ssize(lines));
  const auto line_of = [&](Eigen::Index column) { return lines[static_cast<std::size_t>(column)]; };
  std::ranges::sort(column_, {}, line_of);
  std::ranges::transform(column_, std::back_inserter(lines_), line_of);
  const auto L = std::ssize(lines_);
  sum_.cosine.setZero(outputs, L);
  sum_.pairs.setZero(outputs, L);
}

void AlignmentAverage::add(const RealizationSpectra& spectra, const Eigen::MatrixXcd& G_before,
                           const Eigen::MatrixXcd& G, int workers) {
  const auto N = std::ssize(excited_);
  const auto L = std::ssize(lines_);
  const Eigen::Index E = spectra.experiments();
  Eigen::MatrixXcd residual = Eigen::MatrixXcd::Zero(outputs_ * E, L);
  for_each_line(workers, L, [&](Eigen::Index l) {
    const Eigen::Index column = column_[static_cast<std::size_t>(l)];
    if (column < N && first_) return;
    const Eigen::VectorXcd response =
        column < N ? Eigen::VectorXcd(G_before.col(column))
                   : interpolated_response(excited_, lines_[static_cast<std::size_t>(l)], G);
    const Eigen::Map<const Eigen::MatrixXcd> at(response.data(), outputs_,
                                                response.size() / outputs_);
    const Eigen::MatrixXcd Z = spectra.response(column);
    residual.col(l) = (Z.topRows(outputs_) - at * Z.bottomRows(at.cols())).reshaped();
  });
  for (Eigen::Index e = 0; e < E; ++e) {
    const Eigen::MatrixXcd& mean = spectra.runs()[static_cast<std::size_t>(e)].mean;
    add_run(residual.middleRows(outputs_ * e, outputs_),
            kPowerRounding * mean.topLeftCorner(outputs_, N).cwiseAbs2().rowwise().maxCoeff());
  }
  first_ = false;
}

void AlignmentAverage::add_run(const Eigen::MatrixXcd& residual, const Eigen::VectorXd& smallest) {
  for (Eigen::Index i = 0; i < outputs_; ++i) {
    Eigen::Index before = -1;
    for (Eigen::Index l = 0; l < residual.cols(); ++l) {
      if (!(std::norm(residual(i, l)) > smallest[i])) continue;
      if (before >= 0) {
        const std::complex<double> turn = residual(i, l) * std::conj(residual(i, before));
        sum_.cosine(i, l) += turn.real() / std::abs(turn);
        sum_.pairs(i, l) += 1.0;
      }
      before = l;
    }
  }
}

LineAlignment AlignmentAverage::finish(double resolution_hz) const {
  LineAlignment found = sum_;
  found.frequency_hz =
      resolution_hz *
      Eigen::Map<const Eigen::VectorXi>(lines_.data(), std::ssize(lines_)).cast<double>();
  return found;
}

}  // namespace stageid
