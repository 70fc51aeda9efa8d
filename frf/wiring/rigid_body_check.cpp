#include "frf/wiring/rigid_body_check.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "frf/response/rigid_lines.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kTolerance = 0.1;       // of the rms of a row
constexpr double kLeastLogGain = 0.262;  // ln 1.3
constexpr double kLeastExplained = 20.0;
constexpr double kLeastBodyShare = 0.3;
constexpr double kDead = 0.05;

/// The lines up to where flexible modes begin.
std::vector<PlantLine> lines_of_body(const std::vector<PlantLine>& lines) {
  const auto count = static_cast<Index>(lines.size());
  Eigen::VectorXd omega_rad_s(count), gain(count);
  for (Index k = 0; k < count; ++k) {
    omega_rad_s[k] = lines[static_cast<std::size_t>(k)].omega_rad_s;
    gain[k] = lines[static_cast<std::size_t>(k)].G.norm();
  }
  return {lines.begin(), lines.begin() + rigid_lines(omega_rad_s, gain)};
}

/// A and A0 with their weights.
struct Gains {
  Eigen::MatrixXd A;
  Eigen::MatrixXd A0;
  Eigen::MatrixXd weight;
};

/// The constant terms of entry (i, j) of A and of A0, and their variance.
/// @param suspended with a term for a suspension that differs from the configured one
Eigen::Vector3d fit_entry(const std::vector<PlantLine>& lines, Index i, Index j, bool suspended) {
  const auto K = static_cast<Index>(lines.size());
  const double highest = std::pow(lines.back().omega_rad_s, 2);
  Eigen::MatrixXd X(K, suspended ? 4 : 3);
  Eigen::MatrixXd rhs(K, 2);
  for (Index k = 0; k < K; ++k) {
    const PlantLine& line = lines[static_cast<std::size_t>(k)];
    const double omega2 = std::pow(line.omega_rad_s, 2);
    const double x = omega2 / highest;
    const double row_square = line.G.row(i).squaredNorm() / static_cast<double>(line.G.cols());
    const double variance =
        0.5 * line.variance(i, j) + kRigidModelError * kRigidModelError * row_square;
    const double w = 1.0 / (omega2 * std::sqrt(std::max(1e-300, variance)));
    X.row(k).head<3>() << w, w * x, w * x * x;
    if (suspended) X(k, 3) = w / x;
    rhs.row(k) << -w * omega2 * line.G(i, j).real(), -w * omega2 * line.G0(i, j).real();
  }
  const Eigen::MatrixXd normal_inverse = (X.transpose() * X).inverse();
  const Eigen::MatrixXd solution = normal_inverse * X.transpose() * rhs;
  // The scatter of the lines contains distortion, which the periods do not show.
  const double scatter = (X * solution.col(0) - rhs.col(0)).squaredNorm();
  const double over_variance = scatter / std::max(1.0, static_cast<double>(K - X.cols()));
  return {solution(0, 0), solution(0, 1), std::max(1.0, over_variance) * normal_inverse(0, 0)};
}

Gains fit_gains(const std::vector<PlantLine>& lines, bool suspended) {
  const Index n_y = lines.front().G.rows();
  const Index n_u = lines.front().G.cols();
  Gains gains{Eigen::MatrixXd(n_y, n_u), Eigen::MatrixXd(n_y, n_u), Eigen::MatrixXd(n_y, n_u)};
  Eigen::MatrixXd variance(n_y, n_u);
  for (Index i = 0; i < n_y; ++i)
    for (Index j = 0; j < n_u; ++j) {
      const Eigen::Vector3d entry = fit_entry(lines, i, j, suspended);
      gains.A(i, j) = entry[0];
      gains.A0(i, j) = entry[1];
      variance(i, j) = entry[2];
    }
  const Eigen::VectorXd row_square = gains.A0.rowwise().squaredNorm() / static_cast<double>(n_u);
  gains.weight = (variance.colwise() + kTolerance * kTolerance * row_square).cwiseInverse();
  return gains;
}

struct BodyCandidate {
  ChannelChange change;
  double explained = 0.0;
};

double cost(const Eigen::MatrixXd& A, const Gains& gains) {
  return (gains.weight.array() * (A - gains.A0).array().square()).sum();
}

/// A with the change undone; indices are those in A.
Eigen::MatrixXd undone(const ChannelChange& change, const Eigen::MatrixXd& A) {
  Eigen::MatrixXd B = change.of_sensors ? A : Eigen::MatrixXd(A.transpose());
  if (change.kind == ChannelChange::Kind::swap)
    B.row(change.a).swap(B.row(change.b));
  else if (change.a < 0)
    B /= change.value;
  else
    B.row(change.a) /= change.value;
  return change.of_sensors ? B : Eigen::MatrixXd(B.transpose());
}

void try_gain(ChannelChange change, const Gains& gains, const Eigen::MatrixXd& A,
              std::vector<BodyCandidate>& candidates) {
  // c A = A0 by least squares over the row, the column, or all entries.
  Eigen::MatrixXd part = Eigen::MatrixXd::Zero(A.rows(), A.cols());
  if (change.a < 0)
    part = A;
  else if (change.of_sensors)
    part.row(change.a) = A.row(change.a);
  else
    part.col(change.a) = A.col(change.a);
  const double square = (gains.weight.array() * part.array().square()).sum();
  const double c = (gains.weight.array() * part.array() * gains.A0.array()).sum() / square;
  change.value = 1.0 / c;
  if (!std::isfinite(change.value) || c == 0.0) return;
  if (c > 0.0 && std::abs(std::log(c)) < kLeastLogGain) return;
  candidates.push_back({change, cost(A, gains) - cost(undone(change, A), gains)});
}

std::optional<BodyCandidate> best_change(const Gains& gains, const Eigen::MatrixXd& A) {
  using Kind = ChannelChange::Kind;
  std::vector<BodyCandidate> candidates;
  const double before = cost(A, gains);
  try_gain({Kind::gain, true}, gains, A, candidates);
  for (const bool of_sensors : {true, false}) {
    const Index n = of_sensors ? A.rows() : A.cols();
    for (Index a = 0; a < n; ++a) {
      try_gain({Kind::gain, of_sensors, a}, gains, A, candidates);
      for (Index b = 0; b < a; ++b) {
        const ChannelChange swap{Kind::swap, of_sensors, b, a};
        candidates.push_back({swap, before - cost(undone(swap, A), gains)});
      }
    }
  }
  const BodyCandidate* most = nullptr;
  for (const BodyCandidate& candidate : candidates)
    if (candidate.explained > std::max(kLeastExplained, kLeastBodyShare * before) &&
        (most == nullptr || candidate.explained > most->explained))
      most = &candidate;
  return most != nullptr ? std::optional<BodyCandidate>(*most) : std::nullopt;
}

/// Converts indices in A to those in the log.
ChannelChange in_log(ChannelChange change, const std::vector<Index>& outputs,
                     const std::vector<Index>& inputs) {
  const std::vector<Index>& at = change.of_sensors ? outputs : inputs;
  if (change.a >= 0) change.a = at[static_cast<std::size_t>(change.a)];
  if (change.b >= 0) change.b = at[static_cast<std::size_t>(change.b)];
  return change;
}

}  // namespace

RigidBodyCheck check_rigid_body(const std::vector<PlantLine>& all,
                                const std::vector<Index>& outputs,
                                const std::vector<Index>& inputs) {
  RigidBodyCheck check;
  const std::vector<PlantLine> lines = lines_of_body(all);
  if (static_cast<Index>(lines.size()) < kFewestRigidLines) {
    check.unchecked =
        fmt::format("only {} excited lines between suspension and flexible modes; {} are required",
                    lines.size(), kFewestRigidLines);
    return check;
  }
  check.band_hz[0] = lines.front().omega_rad_s / (2.0 * std::numbers::pi);
  check.band_hz[1] = lines.back().omega_rad_s / (2.0 * std::numbers::pi);
  Gains gains = fit_gains(lines, false);
  if (Gains suspended = fit_gains(lines, true); cost(suspended.A, gains) < cost(gains.A, gains))
    gains = std::move(suspended);
  for (Index j = 0; j < gains.A.cols(); ++j) {
    if (gains.A.col(j).norm() > kDead * gains.A0.col(j).norm()) continue;
    check.dead_actuators.push_back(inputs[static_cast<std::size_t>(j)]);
    gains.weight.col(j).setZero();
  }
  std::vector<ChannelChange> changes;
  Eigen::MatrixXd A = gains.A;
  for (Index i = 0; i < A.rows() + A.cols(); ++i) {
    const std::optional<BodyCandidate> chosen = best_change(gains, A);
    if (!chosen) break;
    A = undone(chosen->change, A);
    changes.push_back(chosen->change);
  }
  const auto deviation = [&] {
    return kTolerance * std::sqrt(cost(A, gains) / static_cast<double>(A.size()));
  };
  if (deviation() > kLargestRigidDeviation) {  // factors do not explain it; the body itself differs
    std::erase_if(changes, [](const ChannelChange& change) {
      return change.kind == ChannelChange::Kind::gain && change.value > 0.0;
    });
    A = gains.A;
    for (const ChannelChange& change : changes) A = undone(change, A);
  }
  check.deviation = deviation();
  for (const ChannelChange& change : changes)
    check.changes.push_back(in_log(change, outputs, inputs));
  return check;
}

}  // namespace stageid
