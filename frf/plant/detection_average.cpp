#include "frf/plant/detection_average.hpp"

#include <algorithm>
#include <iterator>

#include "excitation/threads/worker_pool.hpp"
#include "frf/response/line_estimate.hpp"

namespace stageid {
namespace {

constexpr int kFurthest = 4;

}  // namespace

std::vector<int> detection_lines(const std::vector<int>& excited) {
  std::vector<int> lines;
  for (std::size_t k = 1; k < excited.size(); ++k) {
    for (int line = excited[k - 1] + 1; line < excited[k]; ++line) {
      if (line - excited[k - 1] <= kFurthest || excited[k] - line <= kFurthest)
        lines.push_back(line);
    }
  }
  return lines;
}

Eigen::VectorXcd interpolated_response(const std::vector<int>& excited, int line,
                                       const Eigen::MatrixXcd& G) {
  const auto above = std::ranges::lower_bound(excited, line);
  const int low = *std::prev(above);
  const double t = static_cast<double>(line - low) / (*above - low);
  const Eigen::Index k = above - excited.begin();
  return (1.0 - t) * G.col(k - 1) + t * G.col(k);
}

DetectionAverage::DetectionAverage(const std::vector<int>& lines,
                                   const std::vector<std::string>& axes, bool single_axis,
                                   Eigen::Index outputs)
    : excited_(lines), detection_(detection_lines(lines)), outputs_(outputs) {
  sum_.groups = single_axis ? axes : std::vector<std::string>{"all"};
  const auto D = std::ssize(detection_);
  const auto rows = outputs * std::ssize(sum_.groups);
  sum_.runs.setZero(std::ssize(sum_.groups));
  sum_.power.setZero(rows, D);
  sum_.noise.setZero(outputs, D);
  sum_.linear_power.setZero(rows, std::ssize(lines));
}

void DetectionAverage::add(const RealizationSpectra& spectra, const Eigen::MatrixXcd& G,
                           const std::vector<Eigen::Index>& axis, int workers) {
  noise_known_ = noise_known_ && spectra.scatter_dof() > 0;
  if (!noise_known_ || detection_.empty()) return;
  sum_.noise_dof += spectra.scatter_dof();
  std::vector<Eigen::Index> groups;
  for (std::size_t e = 0; e < axis.size(); ++e) {
    groups.push_back(sum_.groups.size() == 1 ? 0 : axis[e]);
    sum_.runs[groups.back()] += 1.0;
    periods_ += spectra.runs()[e].periods;
  }
  for_each_line(workers, std::ssize(detection_),
                [&](Eigen::Index d) { add_line(spectra, G, groups, d); });
  for_each_line(workers, sum_.linear_power.cols(), [&](Eigen::Index k) {
    const Eigen::MatrixXcd Z = spectra.response(k);
    for (Eigen::Index e = 0; e < Z.cols(); ++e)
      sum_.linear_power.col(k).segment(outputs_ * groups[e], outputs_) +=
          Z.col(e).head(outputs_).cwiseAbs2();
  });
}

void DetectionAverage::add_line(const RealizationSpectra& spectra, const Eigen::MatrixXcd& G,
                                const std::vector<Eigen::Index>& groups, Eigen::Index d) {
  const auto column = std::ssize(excited_) + d;
  const Eigen::MatrixXcd Z = spectra.response(column);
  const Eigen::VectorXcd between = interpolated_response(excited_, detection_[d], G);
  const Eigen::MatrixXcd factor = residual_of_Z(between.reshaped(outputs_, Z.rows() - outputs_));
  const Eigen::MatrixXcd E = factor * Z;
  for (Eigen::Index e = 0; e < E.cols(); ++e)
    sum_.power.col(d).segment(outputs_ * groups[e], outputs_) +=
        spectra.runs()[e].periods * E.col(e).cwiseAbs2();
  const Eigen::MatrixXcd scatter = factor * spectra.scatter(column);
  // The scatter is a sum of squares, but rounding may make it negative.
  sum_.noise.col(d) +=
      (scatter.array() * factor.conjugate().array()).rowwise().sum().real().max(0.0).matrix();
}

DetectionLines DetectionAverage::finish(double resolution_hz) const {
  if (!noise_known_ || detection_.empty() || sum_.runs.size() == 0) return {};
  if (!(sum_.runs.minCoeff() > 0.0) || !(sum_.noise_dof > 0.0)) return {};
  DetectionLines found = sum_;
  found.line = Eigen::Map<const Eigen::VectorXi>(detection_.data(), std::ssize(detection_));
  found.frequency_hz = resolution_hz * found.line.cast<double>();
  const double mean_periods = periods_ / found.runs.sum();
  found.noise /= found.noise_dof * mean_periods;
  found.power /= mean_periods;
  for (Eigen::Index g = 0; g < found.runs.size(); ++g) {
    found.power.middleRows(outputs_ * g, outputs_) /= found.runs[g];
    found.linear_power.middleRows(outputs_ * g, outputs_) /= found.runs[g];
  }
  return found;
}

}  // namespace stageid
