#include "frf/plant/experiment_noise.hpp"

#include <algorithm>
#include <cmath>

#include "excitation/threads/worker_pool.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kByChance = 1e-6;
constexpr double kWorthwhileRatio = 1.3;
constexpr double kDeviations = 5.0;
constexpr Index kFewestLines = 16;
constexpr Index kBlockLines = 64;
constexpr Index kMostBlocks = 16;
constexpr double kRounding = 1e-10;  // of the output's power

}  // namespace

ExperimentNoise::ExperimentNoise(const RealizationSpectra& spectra,
                                 const std::vector<LineEstimate>& lines, double shared, int workers)
    : spectra_(spectra), lines_(static_cast<Index>(lines.size())) {
  const Index E = spectra.experiments();
  for (Index e = 0; e < E; ++e)
    if (spectra.run(static_cast<std::size_t>(e)).scatter_dof == 0) return;
  if (E < 2 || lines_ < kFewestLines) return;
  blocks_ = std::clamp<Index>(lines_ / kBlockLines, 1, kMostBlocks);
  const Index n_y = lines.front().G.rows();

  MatrixXd log_power(n_y * E, lines_);
  for_each_line(workers, lines_, [&](Index k) {
    const std::vector<MatrixXcd> C = covariances(lines[static_cast<std::size_t>(k)], k);
    const Eigen::ArrayXd rounding =
        kRounding * spectra.response(k).topRows(n_y).cwiseAbs2().rowwise().maxCoeff();
    for (Index e = 0; e < E; ++e)
      log_power.col(k).segment(n_y * e, n_y) =
          (C[static_cast<std::size_t>(e)].diagonal().real().array() + rounding).log() -
          mean_of_log_power(spectra.run(static_cast<std::size_t>(e)).dof(k));
  });
  std::vector<MatrixXd> sum(static_cast<std::size_t>(blocks_), MatrixXd::Zero(n_y, E));
  VectorXd count = VectorXd::Zero(blocks_);
  MatrixXd variance = MatrixXd::Zero(E, blocks_);
  for (Index k = 0; k < lines_; ++k) {
    if (!log_power.col(k).allFinite()) continue;  // a constant channel
    const auto block = static_cast<Index>(at(k));
    sum[at(k)] += log_power.col(k).reshaped(n_y, E);
    count[block] += 1.0;
    for (Index e = 0; e < E; ++e)
      variance(e, block) += variance_of_log_power(spectra.run(static_cast<std::size_t>(e)).dof(k));
  }
  blocks_differ_.assign(static_cast<std::size_t>(blocks_), false);
  for (Index b = 0; b < blocks_; ++b) {
    MatrixXd& mean = sum[static_cast<std::size_t>(b)];
    share_.emplace_back(MatrixXd::Ones(n_y, E));
    if (count[b] < kFewestLines) continue;
    mean /= count[b];
    const VectorXd weight =
        variance.col(b).cwiseInverse() * (count[b] * count[b] / std::max(1.0, shared));
    const double ratio = compare(mean, weight);
    blocks_differ_[static_cast<std::size_t>(b)] = ratio > 1.0;
    ratio_ = std::max(ratio_, ratio);
    MatrixXd& share = share_.back();
    share = (mean.colwise() - mean.rowwise().mean()).array().exp();
    share.array().colwise() /= share.rowwise().mean().array();
  }
}

/// The largest ratio of two experiments; 1 unless they differ significantly in an output.
/// @param mean of the logarithms, outputs x experiments; `weight`: one over its variance
double ExperimentNoise::compare(const MatrixXd& mean, const VectorXd& weight) {
  double largest = 1.0;
  const double tests = static_cast<double>(mean.rows() * blocks_);
  for (Index i = 0; i < mean.rows(); ++i) {
    const VectorXd x = mean.row(i).transpose();
    const double centre = x.dot(weight) / weight.sum();
    const double chi_square = weight.dot((x.array() - centre).square().matrix());
    const double ratio = std::exp(x.maxCoeff() - x.minCoeff());
    if (ratio <= kWorthwhileRatio ||
        tail_of_chi_square(chi_square, static_cast<double>(x.size() - 1)) >= kByChance / tests)
      continue;
    largest = std::max(largest, ratio);
    note(x, weight, i);
  }
  return largest;
}

void ExperimentNoise::note(const VectorXd& log_power, const VectorXd& weight, Index output) {
  std::vector<double> values(log_power.begin(), log_power.end());
  const double middle = order_statistic(values, 0.5);
  const Eigen::ArrayXd off = (log_power.array() - middle).abs();
  Index most = 0;
  off.maxCoeff(&most);
  for (Index e = 0; e < off.size(); ++e) {
    const bool differs =
        off[e] > std::log(kWorthwhileRatio) && off[e] * std::sqrt(weight[e]) > kDeviations;
    if (!differs && e != most) continue;
    const double ratio = std::exp(log_power[e] - middle);
    const auto known = std::find_if(odd_.begin(), odd_.end(),
                                    [e](const Odd& other) { return other.experiment == e; });
    if (known == odd_.end())
      odd_.push_back({e, output, ratio});
    else if (off[e] > std::abs(std::log(known->ratio)))
      *known = {e, output, ratio};
  }
}

std::size_t ExperimentNoise::at(Index k) const {
  return static_cast<std::size_t>(k * blocks_ / lines_);
}

std::vector<MatrixXcd> ExperimentNoise::covariances(const LineEstimate& line, Index k) const {
  std::vector<MatrixXcd> C;
  for (Index e = 0; e < spectra_.experiments(); ++e)
    C.push_back(residual_covariance(line.G, spectra_.scatter(static_cast<std::size_t>(e), k),
                                    spectra_.run(static_cast<std::size_t>(e)).scatter_dof));
  return C;
}

LineNoise ExperimentNoise::scaled(const LineEstimate& line, const VectorXd& periods,
                                  Index k) const {
  const MatrixXd& share = share_[at(k)];
  const std::vector<MatrixXcd> C = covariances(line, k);
  LineNoise noise;
  noise.residual.setZero(line.G.rows(), line.G.rows());
  double dof = 0.0;
  for (Index e = 0; e < share.cols(); ++e) {
    const double nu = spectra_.run(static_cast<std::size_t>(e)).dof(k);
    const VectorXd back = share.col(e).cwiseSqrt().cwiseInverse();
    noise.residual += nu * (back.asDiagonal() * C[static_cast<std::size_t>(e)] * back.asDiagonal());
    dof += nu;
  }
  noise.residual /= dof;
  const VectorXd weight = periods.cwiseInverse();
  const VectorXd of_all = share.colwise().mean().transpose().cwiseProduct(weight);
  noise.input_part = line.Q.transpose() * of_all.asDiagonal() * line.Q.conjugate();
  noise.gain = share * weight.asDiagonal() * line.Q.cwiseAbs2();
  noise.mean_of_periods = weight.mean();
  return noise;
}

}  // namespace stageid
