#include "estimation/search/proposed_modes.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/model/basis.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

constexpr double kDampings[] = {0.002, 0.006, 0.02, 0.06};
constexpr double kLeastOwnShare = 0.02;
constexpr Eigen::Index kBlock = 64;

/// Frequencies spaced by a fraction of the half-power width, at least by the line spacing.
std::vector<ModeCandidate> candidate_grid(const FrfEstimate& frf, const AdditiveModel& model) {
  // Below the lines, a suspension represents the whole plant.
  const bool suspended =
      std::any_of(model.submodels.begin(), model.submodels.end(),
                  [](const Submodel& s) { return s.role == SubmodelRole::suspension; });
  const double low = (suspended ? 1.0 : kBelowBand) * frf.frequency_hz[0];
  double high = kAboveBand * frf.frequency_hz[frf.lines() - 1];
  if (model.hold == HoldModel::exact) high = std::min(high, 0.48 * frf.sample_rate_hz);
  const double spacing = frf.lines() > 1
                             ? (frf.frequency_hz[frf.lines() - 1] - frf.frequency_hz[0]) /
                                   static_cast<double>(frf.lines() - 1)
                             : low;
  std::vector<ModeCandidate> grid;
  for (const double zeta : kDampings)
    for (double f = low; f <= high; f += std::max(1.4 * zeta * f, 0.5 * spacing)) {
      // Beside the lines, a width cannot be determined.
      if (side_of_lines(frf, f) != 0 && zeta < 0.02) continue;
      grid.push_back({f, zeta, 1});
    }
  return grid;
}

/// The candidate on the lines, hold and mean delay as factors; sufficient for ranking.
Eigen::VectorXcd candidate_function(const Eigen::VectorXd& f, const Eigen::VectorXcd& factor,
                                    const ModeCandidate& mode) {
  Eigen::VectorXcd out(f.size());
  for (Eigen::Index k = 0; k < f.size(); ++k) {
    const double x = f[k] / mode.frequency_hz;
    out[k] = factor[k] / std::complex<double>(1.0 - x * x, 2.0 * mode.damping_ratio * x);
  }
  return out;
}

Eigen::VectorXcd delay_factor(const FrfEstimate& frf, const AdditiveModel& model) {
  double delay = model.mean_delay_s();
  if (model.hold != HoldModel::none) delay += 0.5 / frf.sample_rate_hz;
  const Eigen::VectorXd omega = frf.omega_rad_s();
  Eigen::VectorXcd out(omega.size());
  for (Eigen::Index k = 0; k < out.size(); ++k) out[k] = std::polar(1.0, -omega[k] * delay);
  return out;
}

/// Orthonormal basis of the functions of the model under the mean weights; real and imaginary parts stacked, 2N x n.
Eigen::MatrixXd own_functions(const FrfEstimate& frf, const AdditiveModel& model,
                              const Eigen::VectorXcd& factor, const Eigen::VectorXd& root_weight) {
  std::vector<Eigen::VectorXcd> functions;
  for (const Submodel& s : model.submodels) {
    if (s.is_mode()) {
      functions.push_back(candidate_function(frf.frequency_hz, factor,
                                             {s.natural_frequency_hz(), s.damping_ratio(), 1}));
    } else if (s.integrators == 2) {
      functions.push_back(
          factor.cwiseQuotient(frf.frequency_hz.cwiseAbs2().cast<std::complex<double>>()));
    } else if (s.denominator.size() == 1) {
      functions.push_back(factor);
    }
  }
  const Eigen::Index N = frf.lines();
  Eigen::MatrixXd columns(2 * N, static_cast<Eigen::Index>(functions.size()));
  for (std::size_t i = 0; i < functions.size(); ++i) {
    const auto c = static_cast<Eigen::Index>(i);
    columns.col(c).head(N) = functions[i].real().cwiseProduct(root_weight);
    columns.col(c).tail(N) = functions[i].imag().cwiseProduct(root_weight);
    columns.col(c).normalize();
  }
  if (columns.cols() == 0) return columns;
  return leading_columns(qr(columns), columns.cols());
}

/// Square root of the mean over channels, each scaled to the same size.
Eigen::VectorXd mean_root_weight(const Eigen::MatrixXd& weights, const Team& team) {
  const Eigen::VectorXd sum =
      sum_over_tiles(team, weights.rows(), weights.cols(), [&](DataRange tile) {
        const auto W = weights.middleRows(tile.first, tile.count);
        const Eigen::VectorXd channel_scale = W.rowwise().mean().cwiseInverse();
        Eigen::VectorXd part(W.cols());
        for (Eigen::Index k = 0; k < part.size(); ++k)
          part[k] = W.col(k).cwiseProduct(channel_scale).sum();
        return part;
      });
  return (sum / static_cast<double>(weights.rows())).cwiseSqrt();
}

/// W E of some channels; real parts of all lines, then imaginary parts.
Eigen::MatrixXd weighted_residual(const FrfEstimate& frf, const AdditiveModel& model,
                                  const Eigen::MatrixXd& weights, const DataRange& channels) {
  const auto [first, rows] = channels;
  const Eigen::MatrixXcd E = frf.response.middleRows(first, rows) -
                             response(model, frf.frequency_hz, model.hold, first, rows);
  Eigen::MatrixXd WE(rows, 2 * frf.lines());
  WE << weights.middleRows(first, rows).cwiseProduct(E.real()),
      weights.middleRows(first, rows).cwiseProduct(E.imag());
  return WE;
}

}  // namespace

std::vector<ProposedMode> proposed_modes(const FrfEstimate& frf, const AdditiveModel& model,
                                         const Eigen::MatrixXd& weights, std::size_t most,
                                         const Workers& workers) {
  const Eigen::Index N = frf.lines();
  const Eigen::VectorXd root_weight = mean_root_weight(weights, *workers.team);
  const Eigen::VectorXcd factor = delay_factor(frf, model);
  const Eigen::MatrixXd own = own_functions(frf, model, factor, root_weight);

  const std::vector<ModeCandidate> grid = candidate_grid(frf, model);
  Eigen::VectorXd share = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(grid.size()));
  const auto blocks = static_cast<int>((grid.size() + kBlock - 1) / kBlock);
  bool share_is_known = own.cols() == 0;
  const auto raw_gain = [&](DataRange channels) {
    const Eigen::MatrixXd WE = weighted_residual(frf, model, weights, channels);
    const auto W = weights.middleRows(channels.first, channels.count);
    Eigen::VectorXd raw(share.size());
    for_each_task(workers.threads, blocks, [&](int block) {
      const auto first = static_cast<Eigen::Index>(block) * kBlock;
      const Eigen::Index count = std::min<Eigen::Index>(kBlock, raw.size() - first);
      Eigen::MatrixXd phi(2 * N, count);
      Eigen::MatrixXd power(N, count);
      for (Eigen::Index i = 0; i < count; ++i) {
        const Eigen::VectorXcd x =
            candidate_function(frf.frequency_hz, factor, grid[static_cast<std::size_t>(first + i)]);
        phi.col(i) << x.real(), x.imag();
        power.col(i) = x.cwiseAbs2();
      }
      const Eigen::MatrixXd correlation = WE * phi;
      const Eigen::MatrixXd norm = W * power;
      raw.segment(first, count) = (correlation.array().square() / norm.array().max(1e-300))
                                      .colwise()
                                      .sum()
                                      .matrix()
                                      .transpose();
      if (share_is_known) return;
      phi.topRows(N).array().colwise() *= root_weight.array();
      phi.bottomRows(N).array().colwise() *= root_weight.array();
      const Eigen::ArrayXd total = phi.colwise().squaredNorm().transpose();
      const Eigen::ArrayXd imitated = (own.transpose() * phi).colwise().squaredNorm().transpose();
      share.segment(first, count) = (1.0 - imitated / total).max(kLeastOwnShare);
    });
    share_is_known = true;
    return raw;
  };
  const Eigen::VectorXd raw =
      sum_over_tiles(*workers.team, frf.response.rows(), share.size(), raw_gain);
  if (!share_is_known) raw_gain(channels_of_tile(0, frf.response.rows()));  // without own tiles
  std::vector<ProposedMode> scored(grid.size());
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    scored[i] = {grid[i], raw[at] / share[at]};
  }
  std::stable_sort(scored.begin(), scored.end(),
                   [](const ProposedMode& a, const ProposedMode& b) { return a.gain > b.gain; });
  std::vector<ProposedMode> best;
  for (const ProposedMode& candidate : scored) {
    if (best.size() == most) break;
    const double hz = candidate.mode.frequency_hz;
    const int side = side_of_lines(frf, hz);
    const bool taken = std::any_of(best.begin(), best.end(), [&](const ProposedMode& other) {
      const double other_hz = other.mode.frequency_hz;
      const double width =
          2.0 * std::max(candidate.mode.damping_ratio, other.mode.damping_ratio) * other_hz;
      // Modes on the same side of the lines are hardly distinguishable.
      return std::abs(hz - other_hz) < width || (side != 0 && side == side_of_lines(frf, other_hz));
    });
    if (!taken) best.push_back(candidate);
  }
  return best;
}

}  // namespace stageid
