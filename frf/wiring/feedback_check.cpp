#include "frf/wiring/feedback_check.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "frf/runs/channel_choice.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

std::string why_not(const HealthRecord& record, const std::vector<Index>& actuators) {
  if (actuators.empty()) return kNamedExcitation;
  if (record.n_y() == 0 || record.lines.empty()) return "sensors and excited lines";
  if (record.experiments() <= record.n_y())
    return fmt::format("more experiments than the {} sensors of the log", record.n_y());
  if (record.scatter_dof() == 0) return "two periods per run";
  return "";
}

constexpr double kExact = 1e-5;  // of the actuator's rms

/// R of excitation channel `r`, repeated for every period, all lines in one column: the same order as Z.
Eigen::VectorXcd over_periods(const HealthRecord& record, Index r) {
  Index columns = 0;
  for (const int periods : record.periods) columns += periods;
  Eigen::VectorXcd all(columns * std::ssize(record.lines));
  Index at = 0;
  for (const LineRecord& line : record.lines)
    for (Index e = 0; e < record.experiments(); ++e)
      for (int p = 0; p < record.periods[e]; ++p) all[at++] = line.R(r, e);
  return all;
}

Eigen::VectorXcd over_periods_of_actuator(const HealthRecord& record, Index a) {
  Index columns = record.lines.empty() ? 0 : record.lines.front().Z.cols();
  Eigen::VectorXcd all(columns * std::ssize(record.lines));
  for (std::size_t k = 0; k < record.lines.size(); ++k)
    all.segment(columns * static_cast<Index>(k), columns) =
        record.lines[k].Z.row(record.n_y() + a).transpose();
  return all;
}

}  // namespace

FeedbackCheck check_feedback(const HealthRecord& record) {
  FeedbackCheck check;
  const std::vector<Index> actuators = excited_actuators(record.info, record.axes);
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
    for (std::size_t a = 0; a < actuators.size(); ++a)
      D.row(actuators[a]) -= line.R.row(record.axes[a]);
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
    if (relative < kLeastMisfit || tail_of_evidence(evidence[a], std::ssize(record.lines)) >
                                       kSignificance / static_cast<double>(n_u))
      continue;
    check.inconsistent.push_back(a);
    check.worst = std::max(check.worst, relative);
  }
  return check;
}

std::vector<MappedExcitation> find_mapped_excitation(const HealthRecord& record) {
  std::vector<MappedExcitation> found;
  for (Index a = 0; a < record.n_u(); ++a) {
    const Eigen::VectorXcd U = over_periods_of_actuator(record, a);
    const double power = U.squaredNorm();
    if (!(power > 0.0)) continue;
    for (const Index r : record.axes) {
      const Eigen::VectorXcd R = over_periods(record, r);
      const double factor = R.dot(U).real() / R.squaredNorm();
      if (!((U - factor * R).squaredNorm() <= kExact * kExact * power)) continue;
      found.push_back({a, r, factor});
      break;
    }
  }
  return found;
}

}  // namespace stageid
