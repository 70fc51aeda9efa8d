#include "frf/wiring/feedback_check.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "acquisition/files/counted.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/wiring/injection_check.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

std::string why_not(const HealthRecord& record, const std::vector<Index>& actuators) {
  for (const Index axis : record.axes)
    if (actuators[static_cast<std::size_t>(axis)] < 0)
      return "an excitation that is added at the actuators and has their names";
  if (record.n_y() == 0 || record.lines.empty()) return "sensors and excited lines";
  if (record.experiments() <= record.n_y())
    return fmt::format("more experiments than the {} sensors of the log", record.n_y());
  if (record.scatter_dof() == 0) return "two periods per run";
  return "";
}

}  // namespace

FeedbackCheck check_feedback(const HealthRecord& record) {
  FeedbackCheck check;
  const std::vector<Index> actuators = actuators_of_excitation(record.info);
  check.unchecked = why_not(record, actuators);
  if (!check.unchecked.empty()) return check;
  check.experiments = static_cast<int>(record.experiments());
  const Index n_u = record.n_u();
  Eigen::VectorXd misfit = Eigen::VectorXd::Zero(n_u);
  Eigen::VectorXd fed_back = Eigen::VectorXd::Zero(n_u);
  Eigen::VectorXd evidence = Eigen::VectorXd::Zero(n_u);
  for (const LineRecord& line : record.lines) {
    Eigen::MatrixXcd D = record.mean(line.Z.bottomRows(n_u));
    const Eigen::VectorXd rounding =
        kFeedbackRounding * kFeedbackRounding * D.cwiseAbs2().rowwise().mean();
    for (const Index axis : record.axes)
      D.row(actuators[static_cast<std::size_t>(axis)]) -= line.R.row(axis);
    const Eigen::MatrixXcd Y = record.mean(line.Z.topRows(record.n_y()));
    // Units of sensors differ, so rows are scaled to one before the rank is determined.
    const Eigen::VectorXd size = Y.rowwise().norm().cwiseMax(1e-300);
    const Eigen::MatrixXcd scaled = size.cwiseInverse().asDiagonal() * Y;
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXcd> qr(scaled.adjoint());
    const Eigen::MatrixXcd F = qr.solve(D.adjoint()).adjoint() * size.cwiseInverse().asDiagonal();
    const Eigen::MatrixXcd rest = D - F * Y;
    const auto dof = static_cast<double>(record.experiments() - qr.rank());
    const Eigen::VectorXd variance =
        record.variance_of_mean(line.Z.bottomRows(n_u) - F * line.Z.topRows(record.n_y()));
    const double whole = static_cast<double>(record.experiments()) / dof;
    for (Index a = 0; a < n_u; ++a) {
      const double square = rest.row(a).squaredNorm();
      misfit[a] += whole * square;
      fed_back[a] += D.row(a).squaredNorm();
      const double noise = variance[a] + rounding[a];
      if (noise > 0.0)
        evidence[a] -=
            log_tail_of_f(square / dof / noise, static_cast<int>(dof), record.scatter_dof());
    }
  }
  if (!(fed_back.sum() > 0.0)) {
    check.unchecked = "a closed loop; here u equals r";
    return check;
  }
  check.relative = std::sqrt(misfit.sum() / fed_back.sum());
  for (Index a = 0; a < n_u; ++a) {
    const double relative = fed_back[a] > 0.0 ? std::sqrt(misfit[a] / fed_back[a]) : 0.0;
    if (relative < kLeastMisfit ||
        tail_of_evidence(evidence[a], static_cast<Index>(record.lines.size())) >
            kFeedbackSignificance / static_cast<double>(n_u))
      continue;
    check.inconsistent.push_back(a);
    check.worst = std::max(check.worst, relative);
  }
  return check;
}

}  // namespace stageid
