#include "frf/wiring/stage_wiring_check.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "frf/response/rigid_lines.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kTolerance = 0.1;       // of the rms of a row
constexpr double kLeastLogGain = 0.262;  // ln 1.3
constexpr double kLeastExplained = 20.0;
constexpr double kDead = 0.05;

/// The lines up to where flexible modes begin; empty if omega^2 |G| falls from the first lines on, as above a mode.
std::vector<PlantLine> lines_of_body(const std::vector<PlantLine>& lines) {
  const auto count = static_cast<Index>(lines.size());
  Eigen::VectorXd omega_rad_s(count), gain(count);
  for (Index k = 0; k < count; ++k) {
    omega_rad_s[k] = lines[k].omega_rad_s;
    gain[k] = lines[k].G.norm();
  }
  const Index rigid = rigid_lines(omega_rad_s, gain);
  std::vector<double> sizes;
  for (Index k = 0; k < rigid; ++k) sizes.push_back(omega_rad_s[k] * omega_rad_s[k] * gain[k]);
  const double largest = sizes.empty() ? 0.0 : std::ranges::max(sizes);
  if (rigid < kFewestRigidLines || largest > kRigidGrowth * order_statistic(sizes, 0.5)) return {};
  return {lines.begin(), lines.begin() + rigid};
}

/// A and A0 with their weights.
struct Gains {
  Eigen::MatrixXd A;
  Eigen::MatrixXd A0;
  Eigen::MatrixXd weight;
};

// Number of terms of a fit over the lines: A alone, with compliance, and with a suspension.
constexpr Index kConstantTerms = 1;
constexpr Index kComplianceTerms = 3;
constexpr Index kSuspensionTerms = 4;

/// The constant terms of entry (i, j) of A and of A0, and their variance.
Eigen::Vector3d fit_entry(const std::vector<PlantLine>& lines, Index i, Index j, Index terms) {
  const auto K = static_cast<Index>(lines.size());
  const double highest = std::pow(lines.back().omega_rad_s, 2);
  Eigen::MatrixXd X(K, terms);
  Eigen::MatrixXd rhs(K, 2);
  for (Index k = 0; k < K; ++k) {
    const PlantLine& line = lines[k];
    const double omega2 = std::pow(line.omega_rad_s, 2);
    const double x = omega2 / highest;
    const double row_square = line.G.row(i).squaredNorm() / static_cast<double>(line.G.cols());
    const double variance =
        0.5 * line.variance(i, j) + kRigidModelError * kRigidModelError * row_square;
    const double w = 1.0 / (omega2 * std::sqrt(std::max(1e-300, variance)));
    const Eigen::Vector4d regressors(w, w * x, w * x * x, w / x);
    X.row(k) = regressors.head(terms);
    rhs.row(k) << -w * omega2 * line.G(i, j).real(), -w * omega2 * line.G0(i, j).real();
  }
  const Eigen::MatrixXd normal_inverse = (X.transpose() * X).inverse();
  const Eigen::MatrixXd solution = normal_inverse * X.transpose() * rhs;
  // The scatter of the lines contains distortion, which the periods do not show.
  const double scatter = (X * solution.col(0) - rhs.col(0)).squaredNorm();
  const double over_variance = scatter / std::max(1.0, static_cast<double>(K - X.cols()));
  return {solution(0, 0), solution(0, 1), std::max(1.0, over_variance) * normal_inverse(0, 0)};
}

Gains fit_gains(const std::vector<PlantLine>& lines, Index terms) {
  const Index n_y = lines.front().G.rows();
  const Index n_u = lines.front().G.cols();
  Gains gains{Eigen::MatrixXd(n_y, n_u), Eigen::MatrixXd(n_y, n_u), Eigen::MatrixXd(n_y, n_u)};
  Eigen::MatrixXd variance(n_y, n_u);
  for (Index i = 0; i < n_y; ++i)
    for (Index j = 0; j < n_u; ++j) {
      const Eigen::Vector3d entry = fit_entry(lines, i, j, terms);
      gains.A(i, j) = entry[0];
      gains.A0(i, j) = entry[1];
      variance(i, j) = entry[2];
    }
  const Eigen::VectorXd row_square = gains.A0.rowwise().squaredNorm() / static_cast<double>(n_u);
  gains.weight = (variance.colwise() + kTolerance * kTolerance * row_square).cwiseInverse();
  return gains;
}

double cost(const Gains& gains) {
  return (gains.weight.array() * (gains.A - gains.A0).array().square()).sum();
}

/// The gains with the error undone; indices are those in A.
Gains undone(const ChannelError& error, Gains gains) {
  Eigen::MatrixXd B = error.of_sensors ? gains.A : Eigen::MatrixXd(gains.A.transpose());
  if (error.kind == ChannelError::Kind::swap)
    B.row(error.a).swap(B.row(error.b));
  else if (error.a < 0)
    B /= error.value;
  else
    B.row(error.a) /= error.value;
  gains.A = error.of_sensors ? B : Eigen::MatrixXd(B.transpose());
  return gains;
}

double explained(const ChannelError& error, const Gains& gains) {
  return cost(gains) - cost(undone(error, gains));
}

/// The gains of all lines, and those of the lower and the upper half of them: a channel's error shows in both, a
/// suspension that the motion stiffens fades above itself.
struct Body {
  Gains all;
  std::array<Gains, 2> halves;
};

Body fit_body(const std::vector<PlantLine>& lines) {
  const auto middle = lines.begin() + static_cast<std::ptrdiff_t>(lines.size() / 2);
  Body body{fit_gains(lines, kComplianceTerms),
            {fit_gains({lines.begin(), middle}, kConstantTerms),
             fit_gains({middle, lines.end()}, kConstantTerms)}};
  // With the weights of the first fit: a term more makes every entry less certain.
  Gains suspended = fit_gains(lines, kSuspensionTerms);
  if (cost({suspended.A, body.all.A0, body.all.weight}) < cost(body.all))
    body.all = std::move(suspended);
  return body;
}

void undo(const ChannelError& error, Body& body) {
  body.all = undone(error, body.all);
  for (Gains& half : body.halves) half = undone(error, half);
}

/// The gain of the error by least squares over the row, the column, or all entries; none where it is too small.
std::optional<ChannelError> gain_error(ChannelError error, const Gains& gains) {
  Eigen::MatrixXd part = Eigen::MatrixXd::Zero(gains.A.rows(), gains.A.cols());
  if (error.a < 0)
    part = gains.A;
  else if (error.of_sensors)
    part.row(error.a) = gains.A.row(error.a);
  else
    part.col(error.a) = gains.A.col(error.a);
  const double square = (gains.weight.array() * part.array().square()).sum();
  const double c = (gains.weight.array() * part.array() * gains.A0.array()).sum() / square;
  error.value = 1.0 / c;
  if (!std::isfinite(error.value) || c == 0.0) return std::nullopt;
  if (c > 0.0 && std::abs(std::log(c)) < kLeastLogGain) return std::nullopt;
  return error;
}

std::optional<ChannelError> best_error(const Body& body) {
  using Kind = ChannelError::Kind;
  std::vector<ChannelError> candidates;
  const auto try_gain = [&](const ChannelError& error) {
    if (const auto gain = gain_error(error, body.all)) candidates.push_back(*gain);
  };
  try_gain({Kind::gain, true});
  for (const bool of_sensors : {true, false}) {
    const Index n = of_sensors ? body.all.A.rows() : body.all.A.cols();
    for (Index a = 0; a < n; ++a) {
      try_gain({Kind::gain, of_sensors, a});
      for (Index b = 0; b < a; ++b) candidates.push_back({Kind::swap, of_sensors, b, a});
    }
  }
  double most = std::max(kLeastExplained, kLeastChangeShare * cost(body.all));
  std::optional<ChannelError> best;
  for (const ChannelError& candidate : candidates) {
    const double gain = explained(candidate, body.all);
    if (gain <= most || std::ranges::any_of(body.halves, [&](const Gains& half) {
          return explained(candidate, half) <= 0.0;
        }))
      continue;
    most = gain;
    best = candidate;
  }
  return best;
}

/// Converts indices in A to those in the log.
ChannelError in_log(ChannelError error, const std::vector<Index>& outputs,
                    const std::vector<Index>& inputs) {
  const std::vector<Index>& at = error.of_sensors ? outputs : inputs;
  if (error.a >= 0) error.a = at[error.a];
  if (error.b >= 0) error.b = at[error.b];
  return error;
}

}  // namespace

StageWiringCheck check_stage_wiring(const std::vector<PlantLine>& all,
                                    const std::vector<Index>& outputs,
                                    const std::vector<Index>& inputs) {
  StageWiringCheck check;
  const std::vector<PlantLine> lines = lines_of_body(all);
  if (static_cast<Index>(lines.size()) < kFewestRigidLines) {
    check.unchecked =
        fmt::format("only {} excited lines between suspension and flexible modes; {} are required",
                    lines.size(), kFewestRigidLines);
    return check;
  }
  check.band_hz[0] = lines.front().omega_rad_s / (2.0 * std::numbers::pi);
  check.band_hz[1] = lines.back().omega_rad_s / (2.0 * std::numbers::pi);
  Body body = fit_body(lines);
  for (Index j = 0; j < body.all.A.cols(); ++j) {
    if (body.all.A.col(j).norm() > kDead * body.all.A0.col(j).norm()) continue;
    check.dead_actuators.push_back(inputs[j]);
    for (Gains* gains : {&body.all, &body.halves[0], &body.halves[1]})
      gains->weight.col(j).setZero();
  }
  const Gains recorded = body.all;
  std::vector<ChannelError> errors;
  for (Index i = 0; i < recorded.A.rows() + recorded.A.cols(); ++i) {
    const std::optional<ChannelError> chosen = best_error(body);
    if (!chosen) break;
    undo(*chosen, body);
    errors.push_back(*chosen);
  }
  const auto deviation = [&] {
    return kTolerance * std::sqrt(cost(body.all) / static_cast<double>(recorded.A.size()));
  };
  if (deviation() > kLargestRigidDeviation) {  // factors do not explain it; the body itself differs
    std::erase_if(errors, [](const ChannelError& error) {
      return error.kind == ChannelError::Kind::gain && error.value > 0.0;
    });
    body.all = recorded;
    for (const ChannelError& error : errors) body.all = undone(error, body.all);
  }
  check.deviation = deviation();
  for (const ChannelError& error : errors) check.errors.push_back(in_log(error, outputs, inputs));
  return check;
}

}  // namespace stageid
