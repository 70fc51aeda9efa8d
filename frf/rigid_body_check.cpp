#include "frf/rigid_body_check.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "frf/line_estimate.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kTolerance = 0.1;       // of the rms of a row
constexpr double kModelError = 0.02;     // of what the fit leaves of flexible modes
constexpr double kLeastLogGain = 0.262;  // ln 1.3
constexpr double kLeastExplained = 20.0;
constexpr double kLeastShare = 0.3;
constexpr double kGrowth = 1.5;
constexpr double kBelowGrowth = 0.7;
constexpr double kDead = 0.05;
constexpr std::size_t kFewestLines = 8;

/// -omega^2 G on the lines of the band, an entry a row, and the variance of each.
struct Accelerance {
  std::vector<double> omega2;
  std::vector<Eigen::MatrixXcd> value;  // n_y x n_u
  std::vector<Eigen::MatrixXcd> nominal;
  std::vector<Eigen::MatrixXd> variance;
};

/// The lines from free_from_hz on, up to where flexible modes begin.
Accelerance accelerance(const HealthRecord& record, const NominalStage& nominal,
                        const std::vector<Index>& outputs, const std::vector<Index>& inputs,
                        RigidBodyCheck& check) {
  std::string missing;
  const auto y = positions_in(nominal.sensors, record.info.sensors.names, missing);
  const auto u = positions_in(nominal.actuators, record.info.actuators.names, missing);
  std::vector<Index> rows = outputs;
  for (const Index a : inputs) rows.push_back(record.n_y() + a);
  const Eigen::VectorXd periods =
      Eigen::Map<const Eigen::VectorXi>(record.periods.data(), record.experiments()).cast<double>();
  Accelerance found;
  std::vector<double> sizes;
  for (Index k = 0; k < record.frequency_hz.size(); ++k) {
    const double frequency_hz = record.frequency_hz[k];
    if (frequency_hz < nominal.free_from_hz) continue;
    const LineRecord& at = record.lines[static_cast<std::size_t>(k)];
    const Eigen::MatrixXcd Z = at.Z(rows, Eigen::all);
    const LineEstimate estimate = estimate_line(at.R(record.axes, Eigen::all), record.mean(Z),
                                                static_cast<Index>(outputs.size()));
    if (estimate.status != LineStatus::good) continue;
    const double omega = 2.0 * std::numbers::pi * frequency_hz;
    const double size = omega * omega * estimate.G.norm();
    sizes.push_back(size);
    std::vector<double> sorted = sizes;
    std::nth_element(sorted.begin(),
                     sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    if (sizes.size() >= kFewestLines && size > kGrowth * sorted[sorted.size() / 2]) {
      while (!found.omega2.empty() && found.omega2.back() > std::pow(kBelowGrowth * omega, 2)) {
        found.omega2.pop_back();
        found.value.pop_back();
        found.nominal.pop_back();
        found.variance.pop_back();
      }
      break;
    }
    const Eigen::MatrixXcd full = nominal.rigid_body(frequency_hz);
    Eigen::MatrixXcd G0(outputs.size(), inputs.size());
    for (std::size_t i = 0; i < outputs.size(); ++i)
      for (std::size_t c = 0; c < inputs.size(); ++c)
        G0(static_cast<Index>(i), static_cast<Index>(c)) =
            full(y[static_cast<std::size_t>(outputs[i])], u[static_cast<std::size_t>(inputs[c])]);
    // The delay is common to all: that of the nominal response, whose largest entry is real but for it.
    Index row = 0;
    Index column = 0;
    G0.cwiseAbs().maxCoeff(&row, &column);
    std::complex<double> turn = G0(row, column) / std::abs(G0(row, column));
    if (turn.real() > 0.0) turn = -turn;
    const std::complex<double> scale = omega * omega / turn;
    found.omega2.push_back(omega * omega);
    found.value.push_back(scale * estimate.G);
    found.nominal.push_back(scale * G0);
    Eigen::MatrixXd variance = Eigen::MatrixXd::Zero(G0.rows(), G0.cols());
    if (record.scatter_dof() > 0) {
      const LineNoise noise =
          line_noise(estimate, record.scatter(Z), record.scatter_dof(), periods);
      variance = noise.residual.diagonal().real() * noise.input_part.diagonal().real().transpose();
    }
    found.variance.push_back(omega * omega * omega * omega * variance);
  }
  if (!found.omega2.empty()) {
    check.band_hz[0] = std::sqrt(found.omega2.front()) / (2.0 * std::numbers::pi);
    check.band_hz[1] = std::sqrt(found.omega2.back()) / (2.0 * std::numbers::pi);
  }
  return found;
}

/// A and A0 with what they are held to.
struct Gains {
  Eigen::MatrixXd A;
  Eigen::MatrixXd A0;
  Eigen::MatrixXd weight;
};

Gains fit_gains(const Accelerance& data) {
  const Index n_y = data.value.front().rows();
  const Index n_u = data.value.front().cols();
  const auto K = static_cast<Index>(data.omega2.size());
  Gains gains{Eigen::MatrixXd(n_y, n_u), Eigen::MatrixXd(n_y, n_u), Eigen::MatrixXd(n_y, n_u)};
  for (Index i = 0; i < n_y; ++i)
    for (Index j = 0; j < n_u; ++j) {
      Eigen::MatrixXd X(K, 3);
      Eigen::MatrixXd rhs(K, 2);
      for (Index k = 0; k < K; ++k) {
        const auto at = static_cast<std::size_t>(k);
        const double x = data.omega2[at] / data.omega2.back();
        const double row_square = data.value[at].row(i).squaredNorm() / static_cast<double>(n_u);
        const double w =
            1.0 / std::sqrt(std::max(1e-300, 0.5 * data.variance[at](i, j) +
                                                 kModelError * kModelError * row_square));
        X.row(k) << w, w * x, w * x * x;
        rhs.row(k) << w * data.value[at](i, j).real(), w * data.nominal[at](i, j).real();
      }
      const Eigen::MatrixXd normal_inverse = (X.transpose() * X).inverse();
      const Eigen::MatrixXd solution = normal_inverse * X.transpose() * rhs;
      gains.A(i, j) = solution(0, 0);
      gains.A0(i, j) = solution(0, 1);
      gains.weight(i, j) = normal_inverse(0, 0);  // the variance, until the tolerance is known
    }
  for (Index i = 0; i < n_y; ++i) {
    const double row_square = gains.A0.row(i).squaredNorm() / static_cast<double>(n_u);
    gains.weight.row(i) =
        (gains.weight.row(i).array() + kTolerance * kTolerance * row_square).inverse();
  }
  return gains;
}

struct Candidate {
  ChannelChange change;
  double explained = 0.0;
};

double cost(const Eigen::MatrixXd& A, const Gains& gains) {
  return (gains.weight.array() * (A - gains.A0).array().square()).sum();
}

/// The rows and columns of A with the change undone; positions are those in A.
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
              std::vector<Candidate>& candidates) {
  // c A = A0 by least squares over the row, the column, or all.
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

std::optional<Candidate> best_change(const Gains& gains, const Eigen::MatrixXd& A) {
  using Kind = ChannelChange::Kind;
  std::vector<Candidate> candidates;
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
  const Candidate* most = nullptr;
  for (const Candidate& candidate : candidates)
    if (candidate.explained > std::max(kLeastExplained, kLeastShare * before) &&
        (most == nullptr || candidate.explained > most->explained))
      most = &candidate;
  return most != nullptr ? std::optional<Candidate>(*most) : std::nullopt;
}

/// From positions in A to those in the log.
ChannelChange in_log(ChannelChange change, const std::vector<Index>& outputs,
                     const std::vector<Index>& inputs) {
  const std::vector<Index>& at = change.of_sensors ? outputs : inputs;
  if (change.a >= 0) change.a = at[static_cast<std::size_t>(change.a)];
  if (change.b >= 0) change.b = at[static_cast<std::size_t>(change.b)];
  return change;
}

}  // namespace

RigidBodyCheck check_rigid_body(const HealthRecord& record, const NominalStage& nominal,
                                const std::vector<Index>& outputs,
                                const std::vector<Index>& inputs) {
  RigidBodyCheck check;
  const Accelerance data = accelerance(record, nominal, outputs, inputs, check);
  if (data.omega2.size() < kFewestLines) {
    check.unchecked = fmt::format(
        "{} excited lines between the suspension ({:.3g} Hz) and the flexible modes; {} are needed",
        data.omega2.size(), nominal.free_from_hz, kFewestLines);
    return check;
  }
  Gains gains = fit_gains(data);
  for (Index j = 0; j < gains.A.cols(); ++j) {
    if (gains.A.col(j).norm() > kDead * gains.A0.col(j).norm()) continue;
    check.dead_actuators.push_back(inputs[static_cast<std::size_t>(j)]);
    gains.weight.col(j).setZero();
  }
  Eigen::MatrixXd A = gains.A;
  for (Index i = 0; i < A.rows() + A.cols(); ++i) {
    const std::optional<Candidate> chosen = best_change(gains, A);
    if (!chosen) break;
    A = undone(chosen->change, A);
    check.changes.push_back(in_log(chosen->change, outputs, inputs));
  }
  check.deviation = kTolerance * std::sqrt(cost(A, gains) / static_cast<double>(A.size()));
  return check;
}

}  // namespace stageid
