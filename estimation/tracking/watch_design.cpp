#include "estimation/tracking/watch_design.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <iterator>
#include <limits>

#include "estimation/tracking/change_detector.hpp"
#include "estimation/tracking/change_naming.hpp"
#include "estimation/tracking/free_motion.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

using Eigen::Index;

constexpr double kTiny = std::numeric_limits<double>::min();
/// Longest window of ChangeDetector.
constexpr int kLongest = 512;

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& M) {
  // Scaled, because a delay in s and a relative gain differ by many decades.
  const Eigen::VectorXd d = M.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = d.asDiagonal() * M * d.asDiagonal();
  return d.asDiagonal() * solve_symmetric(scaled, Eigen::MatrixXd::Identity(M.rows(), M.cols())) *
         d.asDiagonal();
}

/// The lines below each other, real above imaginary parts.
Eigen::MatrixXd stacked(const std::vector<Eigen::MatrixXcd>& lines) {
  const Index n_y = lines.front().rows();
  Eigen::MatrixXd out(2 * n_y * std::ssize(lines), lines.front().cols());
  Index row = 0;
  for (const Eigen::MatrixXcd& line : lines) {
    out.middleRows(row, 2 * n_y) << line.real(), line.imag();
    row += 2 * n_y;
  }
  return out;
}

/// Of `columns` onto the space of B.
Eigen::MatrixXd projection(const Eigen::MatrixXd& B, const Eigen::MatrixXd& columns) {
  const auto factors = pivoted_qr(B);
  const Eigen::MatrixXd basis = leading_columns(factors, factors.rank());
  return basis * (basis.transpose() * columns);
}

/// Periods until the expected statistic of ChangeDetector, with windows of 1, 2, 4, ... periods, reaches the threshold.
/// @param square  of the change over its deviation in one period
double periods_to_detect(double square, double freedom, double threshold, double learned) {
  for (int t = 1; t <= kLongest; ++t)
    for (int w = 1; w < 2 * t && w <= kLongest; w *= 2) {
      const double inside = std::min(t, w);
      const double statistic = square * inside * inside / (w * (1.0 + w / learned));
      if (freedom * std::log1p(statistic / freedom) >= threshold) return t;
    }
  return std::numeric_limits<double>::infinity();
}

}  // namespace

std::vector<LineSensitivity> line_sensitivities(const TrackedResponse& response,
                                                const std::vector<Eigen::MatrixXcd>& U,
                                                const std::vector<Eigen::MatrixXcd>& C) {
  const Index n_y = response.model().n_outputs();
  const Eigen::VectorXd at_model = Eigen::VectorXd::Zero(response.size());
  std::vector<Eigen::MatrixXcd> whitening;
  std::ranges::transform(C, std::back_inserter(whitening), inverse_cholesky);
  std::vector<LineSensitivity> out(U.size());
  for (Index j = 0; j < U.front().cols(); ++j) {
    Eigen::MatrixXcd of_signal(U.front().rows(), std::ssize(U));
    for (Index k = 0; k < of_signal.cols(); ++k) of_signal.col(k) = U[k].col(j);
    const Eigen::MatrixXcd J = response.derivatives(at_model, of_signal);
    for (std::size_t k = 0; k < U.size(); ++k)
      out[k].emplace_back(whitening[k] * J.middleRows(static_cast<Index>(k) * n_y, n_y));
  }
  return out;
}

std::vector<Eigen::MatrixXcd> line_motions(const TrackedResponse& response,
                                           const std::vector<Eigen::MatrixXcd>& C) {
  const Eigen::MatrixXcd motions = free_motions(response).front();
  std::vector<Eigen::MatrixXcd> out;
  for (const Eigen::MatrixXcd& of_line : C) {
    const Index n_y = of_line.rows();
    out.emplace_back(inverse_cholesky(of_line) * motions.middleRows(std::ssize(out) * n_y, n_y));
  }
  return out;
}

Eigen::MatrixXcd sensitivity(const LineSensitivity& line, const Eigen::VectorXcd& r) {
  Eigen::MatrixXcd J = r[0] * line[0];
  for (std::size_t j = 1; j < line.size(); ++j) J += r[j] * line[j];
  return J;
}

Eigen::MatrixXd information(const Eigen::MatrixXcd& J) { return 2.0 * (J.adjoint() * J).real(); }

InformativePower most_informative_power(const std::vector<Eigen::MatrixXd>& information,
                                        const Eigen::MatrixXd& prior, const Eigen::VectorXd& scale,
                                        const Eigen::MatrixXd& bounds, int iterations) {
  std::vector<Index> wanted;
  for (Index i = 0; i < scale.size(); ++i)
    if (scale[i] > 0.0) wanted.push_back(i);
  require(!wanted.empty(), "no parameter has a scale; nothing to design");
  Eigen::ArrayXd w = Eigen::ArrayXd::Ones(std::ssize(wanted));
  w /= w.sum();
  Eigen::VectorXd lambda = Eigen::VectorXd::Ones(bounds.rows());
  InformativePower out;
  out.variance.setZero(scale.size());
  out.power = bounds.colwise().sum().cwiseInverse().transpose();
  out.power /= (bounds * out.power).maxCoeff();
  for (int i = 0;; ++i) {
    Eigen::MatrixXd M = prior;
    for (Index k = 0; k < out.power.size(); ++k) M += out.power[k] * information[k];
    const Eigen::MatrixXd inverse = inverse_of(M);
    const Eigen::ArrayXd variance = inverse.diagonal()(wanted);
    const Eigen::ArrayXd ratio = variance / scale(wanted).array().square();
    out.variance(wanted) = ratio;
    out.gradient_root = inverse(Eigen::all, wanted) * (w / variance).sqrt().matrix().asDiagonal();
    const Eigen::MatrixXd W = out.gradient_root * out.gradient_root.transpose();
    Eigen::ArrayXd d(out.power.size());
    for (Index k = 0; k < d.size(); ++k) d[k] = W.cwiseProduct(information[k]).sum();
    const Eigen::ArrayXd price = bounds.transpose() * lambda;
    // The weighted mean of ln variance is below its maximum; by duality, no power lowers that mean by more than
    // max_k (d_k / price_k) sum lambda - d^T p.
    out.gap = std::log(ratio.maxCoeff()) - (w * ratio.log()).sum() +
              (d / price).maxCoeff() * lambda.sum() - d.matrix().dot(out.power);
    if (i == iterations) return out;
    out.power.array() *= d / price;
    const Eigen::VectorXd use = bounds * out.power;
    lambda.array() *= use.array();
    out.power /= use.maxCoeff();
    w *= (ratio / ratio.maxCoeff()).sqrt();
    w /= w.sum();
  }
}

Eigen::VectorXcd most_informative_phases(const LineSensitivity& line, const Eigen::MatrixXd& V,
                                         Eigen::VectorXcd r) {
  // tr(V^T M_k V) = 2 |Z r|^2
  Eigen::MatrixXcd Z(line.front().rows() * V.cols(), r.size());
  for (Index j = 0; j < r.size(); ++j) Z.col(j) = (line[j] * V).reshaped();
  const Eigen::MatrixXcd Q = Z.adjoint() * Z;
  constexpr int kSweeps = 5;
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (Index j = 0; j < r.size(); ++j) {
      const std::complex<double> others =
          Q.row(j).transpose().cwiseProduct(r).sum() - Q(j, j) * r[j];
      if (others != 0.0) r[j] = others / std::abs(others);
    }
  return r;
}

WatchForecast watch_forecast(const std::vector<Eigen::MatrixXcd>& J,
                             const std::vector<Eigen::MatrixXcd>& motions,
                             const Eigen::MatrixXd& prior, const Eigen::VectorXd& change,
                             const TrackerOptions& options) {
  const double n = options.learning_periods;
  const Eigen::MatrixXd beside = stacked(J) - projection(stacked(motions), stacked(J));
  Eigen::MatrixXd M = 2.0 * beside.transpose() * beside;
  Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(prior.rows());
  const Index rows = 2 * J.front().rows();
  for (Index row = 0; row < beside.rows(); row += rows)
    squares +=
        (2.0 * beside.middleRows(row, rows).colwise().squaredNorm().transpose().array()).square();
  // As many degrees of freedom as LineNoise::covariance() finds.
  const Eigen::VectorXd freedom =
      ((n - 2.0) * M.diagonal().array().square() / squares.max(kTiny)).max(n - 2.0);
  // Weights from the noise of n periods instead of the true one.
  M *= 1.0 - std::min(0.5, static_cast<double>(J.front().rows()) / n);
  WatchForecast out;
  out.deviation = inverse_of(M + prior).diagonal().cwiseSqrt();
  const Eigen::VectorXd per_score = M.diagonal().array().max(kTiny).rsqrt();
  const double threshold =
      ChangeDetector(per_score.asDiagonal() * M * per_score.asDiagonal(), freedom,
                     options.false_alarms_per_period, options.learning_periods)
          .threshold();
  out.periods.resize(M.rows());
  for (Index p = 0; p < M.rows(); ++p)
    out.periods[p] = std::max<double>(
        kPeriodsToName + 1,
        periods_to_detect(change[p] * change[p] * M(p, p), freedom[p], threshold, n));
  return out;
}

}  // namespace stageid
