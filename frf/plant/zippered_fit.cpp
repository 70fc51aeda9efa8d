#include "frf/plant/zippered_fit.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "frf/runs/excitation_spectrum.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/statistics/local_fit.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;

// Two close modes and the flank of a third one. Numerators have the same order, so that modes outside the window
// can be represented in addition to the poles.
constexpr int kMostPoles = 3;
constexpr double kNarrowestPole = 0.2;
// Below this probability of the misfit under noise, the residual replaces the noise instead of being pooled.
constexpr double kMisfitByChance = 0.01;

/// The matrix A for which A kron diag(C_E) equals the covariance due to the uncertainty of D, F_i F_i^H with
/// F_i = [I, -G] X_i U^-1, in the mean over the outputs.
MatrixXcd pole_part(const LineEstimate& line, const MatrixXcd& pole_spread,
                    const Eigen::VectorXd& variance) {
  const Index n_u = line.Q.cols();
  MatrixXcd part = MatrixXcd::Zero(n_u, n_u);
  if (!(variance.minCoeff() > 0.0)) return part;
  const MatrixXcd factor = residual_of_Z(line.G);
  const Eigen::VectorXd weight = variance.cwiseInverse() / static_cast<double>(variance.size());
  for (Index i = 0; i < pole_spread.cols(); ++i) {
    const MatrixXcd X = pole_spread.col(i).reshaped(factor.cols(), n_u);
    const MatrixXcd F = factor * X * line.Q;
    part += F.transpose() * weight.asDiagonal() * F.conjugate();
  }
  return part;
}

}  // namespace

ZipperedFit::ZipperedFit(ZipperedLines lines, Index outputs)
    : lines_(std::move(lines)),
      outputs_(outputs),
      bins_(zippered_window(static_cast<int>(lines_.axes))) {
  for (Index p = 0; p < lines_.axes; ++p) of_axis_.push_back(lines_.of(p));
}

/// The nearest lines of each axis, axis by axis, ascending.
std::vector<Index> ZipperedFit::window(Index k) const {
  std::vector<Index> window;
  for (const std::vector<Index>& own : of_axis_) {
    auto first = own.begin();
    while (own.end() - first > bins_ &&
           std::abs(line(first[bins_]) - line(k)) < std::abs(line(*first) - line(k)))
      ++first;
    window.insert(window.end(), first, first + bins_);
  }
  return window;
}

ZipperedEstimate ZipperedFit::estimate(const RealizationSpectra& spectra, Index k) const {
  const RunSpectra& run = spectra.runs().front();
  const std::vector<Index> window = this->window(k);
  const auto B = std::ssize(window);
  const Index axes = lines_.axes;
  LocalProblem problem;
  problem.Z.resize(run.mean.rows(), B);
  problem.r.resize(B);
  Eigen::VectorXcd R(B);
  for (Index i = 0; i < B; ++i) {
    const Index at = window[i];
    problem.Z.col(i) = run.mean.col(at);
    problem.r[i] = line(at) - line(k);
    R[i] = spectra.excitation(at)(i / bins_, 0);
  }
  problem.r /= problem.r.cwiseAbs().maxCoeff();
  set_polynomials(problem, kRegressors - 1);
  problem.K *= R.asDiagonal();
  problem.groups.assign(axes, bins_);
  problem.independent_noise = outputs_;
  problem.pole_channels = outputs_;
  problem.tested_noise = outputs_;
  problem.narrowest_pole = kNarrowestPole;

  const LocalFit fit = average_locally(problem, kMostPoles);
  ZipperedEstimate result;
  result.line = estimate_line(MatrixXcd::Identity(axes, axes), fit.value, outputs_);
  if (result.line.status != LineStatus::good) return result;
  result.variance_share = (fit.weight.array() * R.array()).abs2().sum() / static_cast<double>(axes);

  // For the mean of periods, the data of the local model.
  const MatrixXcd left = residual_of_Z(result.line.G) * fit.residual;
  const Eigen::VectorXd left_variance = left.rowwise().squaredNorm() / fit.dof;
  const bool from_periods = spectra.scatter_dof() > 0;
  const double periods = from_periods ? run.periods : 1.0;
  const Eigen::VectorXd effective = periods * fit.leverage.cwiseInverse();
  if (from_periods) {
    MatrixXcd scatter = MatrixXcd::Zero(problem.Z.rows(), problem.Z.rows());
    Eigen::VectorXd share = fit.weight.cwiseAbs2();
    for (Index p = 0; p < axes; ++p) {
      auto own = share.segment(p * bins_, bins_);
      own /= own.sum() * static_cast<double>(axes);
    }
    double scarcity = 0.0;  // 1 / degrees of freedom
    for (Index i = 0; i < B; ++i) {
      const Index line = window[i];
      scatter += share[i] * spectra.scatter(line);
      for (Index j = 0; j < B; ++j) {
        const Index other = window[j];
        scarcity += share[i] * share[j] * common_scatter(run, line, other) /
                    std::sqrt(spectra.scatter_dof(line) * spectra.scatter_dof(other));
      }
    }
    result.noise = line_noise(result.line, scatter, spectra.scatter_dof(), effective);
    const double dof = 1.0 / scarcity;
    const Eigen::VectorXd noise = result.noise.residual.diagonal().real() / periods;
    if (noise.minCoeff() > 0.0) result.misfit = left_variance.cwiseQuotient(noise).mean();
    if (result.misfit > 1.0 && log_tail_of_f(result.misfit, static_cast<int>(std::ceil(fit.dof)),
                                             dof) < std::log(kMisfitByChance)) {
      // The misfit exceeds the noise, and the value contains part of it.
      result.noise.residual *= result.misfit;
      result.noise_dof = fit.variance_dof;
    } else {
      result.noise_dof = dof + fit.variance_dof;
      const double share_of_left = fit.variance_dof / (result.noise_dof * fit.dof);
      result.noise.residual = dof / result.noise_dof * result.noise.residual +
                              periods * share_of_left * left * left.adjoint();
    }
  } else {
    // Divided by fit.dof here, because it is not an integer if there are poles.
    const MatrixXcd scatter = fit.residual * fit.residual.adjoint() / fit.dof;
    result.noise = line_noise(result.line, scatter, 1, effective);
    result.noise_dof = fit.variance_dof;
  }
  result.noise.mean_of_periods = 1.0 / periods;
  if (fit.pole_spread.cols() > 0)
    result.noise.input_part +=
        pole_part(result.line, fit.pole_spread, result.noise.residual.diagonal().real());
  return result;
}

int zippered_window(int axes) {
  constexpr int kDof = 6;
  constexpr int kLeastDofOfAnAxis = 2;
  return ZipperedFit::kRegressors + std::max(kLeastDofOfAnAxis, (kDof + axes - 1) / axes);
}

bool is_zippered(const LogReader& log) {
  if (log.runs().empty()) return false;
  RealDft dft(log.info().period_samples);
  const Eigen::MatrixXd period = log.excitation(0);
  if (period.rows() != dft.length()) return false;
  return excitation_spectrum(period, dft).is_zippered();
}

std::vector<Eigen::Index> ZipperedLines::of(Eigen::Index wanted) const {
  std::vector<Eigen::Index> positions;
  for (std::size_t k = 0; k < axis.size(); ++k)
    if (axis[k] == wanted) positions.push_back(static_cast<Eigen::Index>(k));
  return positions;
}

Eigen::Index ZipperedLines::first() const {
  Eigen::Index first = 0;
  for (Eigen::Index p = 0; p < axes; ++p) first = std::max(first, of(p).front());
  return first;
}

Eigen::Index ZipperedLines::last() const {
  Eigen::Index last = std::ssize(axis) - 1;
  for (Eigen::Index p = 0; p < axes; ++p) last = std::min(last, of(p).back());
  return last;
}

void require_enough_lines(const ZipperedLines& lines, const std::vector<std::string>& names,
                          const std::string& place) {
  const auto needed = static_cast<std::size_t>(zippered_window(static_cast<int>(lines.axes)));
  for (Eigen::Index p = 0; p < lines.axes; ++p) {
    const std::size_t there = lines.of(p).size();
    if (there >= needed) continue;
    fail_request(
        "{}: zippered lines: {} is excited on {} of the {} lines, but {} are required to "
        "interpolate its responses. Lengthen the period, widen the band, or excite all axes on all "
        "lines in {} experiments (orthogonal_dft)",
        place, names[p], there, lines.lines.size(), needed, lines.axes);
  }
}

}  // namespace stageid
