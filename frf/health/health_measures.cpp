#include "frf/health/health_measures.hpp"

#include <array>
#include <limits>
#include <vector>

#include "excitation/decompositions/decompositions.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

}  // namespace

bool above_noise(const HealthRecord& record, Index channel,
                 const std::function<Eigen::RowVectorXcd(Index)>& response) {
  if (record.scatter_dof() == 0) return true;
  double evidence = 0.0;
  for (std::size_t k = 0; k < record.lines.size(); ++k) {
    const double variance = record.variance_of_mean(record.lines[k].Z.row(channel))[0];
    const double mean_square =
        response(k).squaredNorm() / static_cast<double>(record.experiments());
    if (variance > kPowerRounding * mean_square)
      evidence -= log_tail_of_f(mean_square / variance, static_cast<int>(record.experiments()),
                                record.scatter_dof());
    else if (mean_square > 0.0)
      return true;
  }
  return tail_of_evidence(evidence, std::ssize(record.lines)) < kSignificance;
}

bool responds(const HealthRecord& record, Index channel) {
  return above_noise(record, channel, [&](Index k) -> Eigen::RowVectorXcd {
    return record.mean(record.lines[k].Z.row(channel));
  });
}

double median_coherence(const HealthRecord& record, Index channel) {
  std::vector<double> values;
  for (const LineRecord& line : record.lines) {
    const Eigen::MatrixXcd row = line.Z.row(channel);
    const double power = row.squaredNorm();
    if (power > 0.0) values.push_back(1.0 - record.scatter(row)(0, 0).real() / power);
  }
  if (values.empty()) return 1.0;
  return order_statistic(values, 0.5);
}

double common_motion(const HealthRecord& record, Index one, Index other) {
  const auto dof = static_cast<double>(record.scatter_dof());
  if (dof < 2.0) return 0.0;
  std::vector<double> values;
  for (const LineRecord& line : record.lines) {
    const Eigen::MatrixXcd S = record.scatter(line.Z(std::array{one, other}, Eigen::all));
    const double power = S(0, 0).real() * S(1, 1).real();
    if (power > 0.0) values.push_back((dof * std::norm(S(0, 1)) / power - 1.0) / (dof - 1.0));
  }
  return values.empty() ? 0.0 : order_statistic(values, 0.5);
}

double noise_share(const HealthRecord& record) {
  std::vector<double> values;
  for (const LineRecord& line : record.lines) {
    const Eigen::MatrixXcd Y = line.Z.topRows(record.n_y());
    const double power = record.mean(Y).squaredNorm() / static_cast<double>(record.experiments());
    if (power > 0.0) values.push_back(record.variance_of_mean(Y).sum() / power);
  }
  return values.empty() ? 0.0 : order_statistic(values, 0.5);
}

double condition(const Eigen::MatrixXcd& M) {
  const Eigen::VectorXd row_norm = M.rowwise().norm();
  if (!(row_norm.minCoeff() > 0.0)) return std::numeric_limits<double>::infinity();
  const Eigen::VectorXd values =
      svd(Eigen::MatrixXcd(row_norm.cwiseInverse().asDiagonal() * M), 0).singularValues();
  return values[0] / values[values.size() - 1];
}

}  // namespace stageid
