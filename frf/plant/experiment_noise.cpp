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
constexpr double kRounding = 1e-10;  // of the output's power

/// Factor of the variance of a block's mean if its lines are not independent, outputs x blocks.
MatrixXd dependence_of(const RealizationSpectra& spectra, Index outputs, Index blocks) {
  MatrixXd common = MatrixXd::Zero(outputs, blocks);
  MatrixXd own = MatrixXd::Zero(outputs, blocks);
  for (const RunSpectra& run : spectra.runs()) {
    if (run.common_sum.size() == 0) continue;
    common += run.common_sum;
    own += run.own_sum;
  }
  return (own.array() > 0.0).select((common.array() / own.array()).max(1.0), 1.0);
}

}  // namespace

ExperimentNoise::ExperimentNoise(const RealizationSpectra& spectra,
                                 const std::vector<LineEstimate>& lines, double shared, int workers)
    : spectra_(spectra),
      lines_(std::ssize(lines)),
      outputs_(lines.empty() ? 0 : lines.front().G.rows()) {
  const std::vector<RunSpectra>& runs = spectra.runs();
  const Index E = spectra.experiments();
  const Index n_y = outputs_;
  if (lines_ < kFewestLines || std::ranges::find(runs, 0, &RunSpectra::scatter_dof) != runs.end())
    return;
  const Index blocks = noise_blocks(lines_);

  MatrixXd log_power(n_y * E, lines_);
  for_each_line(workers, lines_, [&](Index k) {
    const std::vector<MatrixXcd> C = covariances(lines[k], k);
    const Eigen::ArrayXd rounding =
        kRounding * spectra.response(k).topRows(n_y).cwiseAbs2().rowwise().maxCoeff();
    for (Index e = 0; e < E; ++e)
      log_power.col(k).segment(n_y * e, n_y) =
          (C[e].diagonal().real().array() + rounding).log() - mean_of_log_power(runs[e].dof(k));
  });
  levels_.realization = spectra.realization();
  levels_.log_power.assign(blocks, MatrixXd::Zero(n_y, E));
  levels_.weight = levels_.log_power;
  levels_.differs.setConstant(n_y, blocks, false);
  VectorXd count = VectorXd::Zero(blocks);
  MatrixXd variance = MatrixXd::Zero(E, blocks);
  for (Index k = 0; k < lines_; ++k) {
    if (!log_power.col(k).allFinite()) continue;  // a constant channel
    const Index block = at(k);
    levels_.log_power[block] += log_power.col(k).reshaped(n_y, E);
    count[block] += 1.0;
    for (Index e = 0; e < E; ++e) variance(e, block) += variance_of_log_power(runs[e].dof(k));
  }
  const MatrixXd dependence = dependence_of(spectra, n_y, blocks);
  for (Index block = 0; block < blocks; ++block) {
    MatrixXd& mean = levels_.log_power[block];
    share_.emplace_back(MatrixXd::Ones(n_y, E));
    blocks_differ_.push_back(false);
    if (count[block] < kFewestLines) continue;
    mean /= count[block];
    const VectorXd weight =
        variance.col(block).cwiseInverse() * (count[block] * count[block] / std::max(1.0, shared));
    levels_.weight[block] = dependence.col(block).cwiseInverse() * weight.transpose();
    if (E < 2) continue;
    const double ratio = compare(block);
    blocks_differ_[block] = ratio > 1.0;
    ratio_ = std::max(ratio_, ratio);
    MatrixXd& share = share_.back();
    share = (mean.colwise() - mean.rowwise().mean()).array().exp();
    share.array().colwise() /= share.rowwise().mean().array();
  }
}

/// The largest ratio of two experiments; 1 unless they differ significantly in an output.
double ExperimentNoise::compare(Index block) {
  double largest = 1.0;
  const MatrixXd& mean = levels_.log_power[block];
  const double tests =
      static_cast<double>(mean.rows()) * static_cast<double>(levels_.log_power.size());
  for (Index i = 0; i < mean.rows(); ++i) {
    const VectorXd x = mean.row(i).transpose();
    const VectorXd weight = levels_.weight[block].row(i).transpose();
    const double centre = x.dot(weight) / weight.sum();
    const double chi_square = weight.dot((x.array() - centre).square().matrix());
    const double ratio = std::exp(x.maxCoeff() - x.minCoeff());
    const double dof = std::max(1.0, weight.minCoeff());
    const auto E = static_cast<double>(x.size());
    if (ratio <= kWorthwhileRatio || tail_of_chi_square(chi_square, E - 1.0) >= kByChance / tests ||
        log_tail_of_f(ratio, static_cast<int>(std::min(dof, 1e6)), dof) >=
            std::log(kByChance / tests / (E * (E - 1.0))))
      continue;
    levels_.differs(i, block) = true;
    largest = std::max(largest, ratio);
  }
  return largest;
}

VectorXd ExperimentNoise::level(Index k) const {
  if (levels_.log_power.empty() || !(levels_.weight[at(k)].minCoeff() > 0.0))
    return VectorXd::Ones(outputs_);
  return levels_.log_power[at(k)].array().exp().matrix().rowwise().mean();
}

std::vector<OddRun> odd_runs(const std::vector<NoiseLevels>& realizations) {
  std::vector<OddRun> found;
  const auto note = [&found](const OddRun& run) {
    const auto known = std::ranges::find_if(found, [&run](const OddRun& other) {
      return other.realization == run.realization && other.experiment == run.experiment;
    });
    if (known == found.end())
      found.push_back(run);
    else if (std::abs(std::log(run.ratio)) > std::abs(std::log(known->ratio)))
      *known = run;
  };
  std::vector<const NoiseLevels*> known;
  for (const NoiseLevels& one : realizations)
    if (one.differs.size() > 0) known.push_back(&one);
  if (known.empty()) return found;
  for (Index b = 0; b < known.front()->differs.cols(); ++b)
    for (Index i = 0; i < known.front()->differs.rows(); ++i) {
      if (std::ranges::none_of(known, [&](const NoiseLevels* one) { return one->differs(i, b); }))
        continue;
      std::vector<double> values;
      for (const NoiseLevels* one : known)
        for (const double x : one->log_power[b].row(i)) values.push_back(x);
      const double middle = value_of_rank(values, (values.size() - 1) / 2);
      OddRun most;
      double largest = 0.0;
      bool any = false;
      for (const NoiseLevels* one : known) {
        const MatrixXd& x = one->log_power[b];
        for (Index e = 0; e < x.cols(); ++e) {
          const double off = std::abs(x(i, e) - middle);
          const OddRun run{one->realization, e, i, std::exp(x(i, e) - middle)};
          if (off > largest) {
            largest = off;
            most = run;
          }
          if (!(off > std::log(kWorthwhileRatio)) ||
              !(off * std::sqrt(one->weight[b](i, e)) > kDeviations))
            continue;
          note(run);
          any = true;
        }
      }
      if (!any && largest > 0.0) note(most);
    }
  return found;
}

Index ExperimentNoise::at(Index k) const { return noise_block(k, lines_); }

std::vector<MatrixXcd> ExperimentNoise::covariances(const LineEstimate& line, Index k) const {
  std::vector<MatrixXcd> C;
  for (const RunSpectra& run : spectra_.runs())
    C.push_back(residual_covariance(line.G, run.scatter(k), run.scatter_dof));
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
    const double nu = spectra_.runs()[e].dof(k);
    const VectorXd back = share.col(e).cwiseSqrt().cwiseInverse();
    noise.residual += nu * (back.asDiagonal() * C[e] * back.asDiagonal());
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
