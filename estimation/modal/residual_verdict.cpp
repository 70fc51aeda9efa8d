#include "estimation/modal/residual_verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "excitation/threads/team.hpp"
#include "frf/response/neighbour_scatter.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {
namespace {

// times the variance: the error of the model is then as large as the noise
constexpr double kAllowed = 2.0;
constexpr double kByChance = 1e-3;   // probability that any part of a right model is not explained
constexpr Eigen::Index kRun = 32;    // lines judged together
constexpr double kRounding = 1e-20;  // of the power of a channel: no measurement is more exact

/// Sums over one part of the data.
struct Part {
  std::string place;
  double t = 0.0;
  double r = 0.0;
  double entries = 0.0;
  double lines = 0.0;  ///< with at least one entry

  void add(double t_of_entry, double r_of_entry) {
    t += t_of_entry;
    r += r_of_entry;
    entries += 1.0;
  }
  double mean_t() const { return entries > 0.0 ? t / entries : 0.0; }
  double mean_r() const { return entries > 0.0 ? r / entries : 0.0; }
};

/// The parts of the data, judged by one variance.
class Parts {
 public:
  Parts(const FrfEstimate& frf, double dof)
      : frf_(frf), dof_(dof), share_(Eigen::VectorXd::Zero(frf.response.rows())) {
    rounding_ =
        kRounding * sum_over_tiles(*frf.team, share_.size(), frf.lines(), [&](DataRange tile) {
          const Eigen::MatrixXcd G = frf.response.middleRows(tile.first, tile.count);
          share_.segment(tile.first, tile.count) = G.rowwise().squaredNorm();
          return Eigen::VectorXd(G.colwise().squaredNorm().transpose());
        });
    const auto of_tile = [&](DataRange tile) {
      return Eigen::VectorXd(share_.segment(tile.first, tile.count)).sum();
    };
    share_ /= std::max(number_over_tiles(*frf.team, share_.size(), of_tile),
                       std::numeric_limits<double>::min());
    parts_.push_back({});
    for (const std::string& name : frf.outputs.names) parts_.push_back({"output " + name});
    for (const std::string& name : frf.inputs.names) parts_.push_back({"input " + name});
    for (Eigen::Index first = 0; first < frf.lines(); first += kRun) {
      const Eigen::Index last = std::min(first + kRun, frf.lines()) - 1;
      parts_.push_back(
          {fmt::format("{:.4g} to {:.4g} Hz", frf.frequency_hz[first], frf.frequency_hz[last])});
    }
  }

  /// Adds one line of some channels: residual, variance and weights (empty: all count).
  void add_line(Eigen::Index k, Eigen::Index first_channel,
                const Eigen::Ref<const Eigen::VectorXcd>& residual,
                const Eigen::Ref<const Eigen::VectorXd>& variance,
                const Eigen::Ref<const Eigen::VectorXd>& weights) {
    for (Eigen::Index r = 0; r < residual.size(); ++r) {
      if (!counts(variance[r], weights.size() > 0 ? weights[r] : 1.0)) continue;
      const double ratio =
          std::norm(residual[r]) / (variance[r] + rounding_[k] * share_[first_channel + r]);
      const double scaled = ratio / kAllowed;
      const double t = dof_ > 0.0 ? dof_ * std::log1p(scaled / dof_) : scaled;
      for (const std::size_t p : parts_of(first_channel + r, k)) parts_[p].add(t, ratio);
    }
  }

  /// Counts the lines of every part. Like add_line(), but for all channels.
  void count_lines(const Eigen::MatrixXd& variance, const Eigen::MatrixXd& weights) {
    const auto [own, count] = frf_.own();
    const auto entry_counts = [&](Eigen::Index c, Eigen::Index k) {
      return counts(variance(c, k), weights.rows() > 0 ? weights(c, k) : 1.0);
    };
    bool all_count = true;
    for (Eigen::Index k = 0; k < frf_.lines(); ++k)
      for (Eigen::Index c = own; c < own + count; ++c) all_count &= entry_counts(c, k);
    all_count = !frf_.any(!all_count);
    const Eigen::Index of_lines = 1 + frf_.n_outputs() + frf_.n_inputs();
    for (std::size_t p = 0; all_count && p < parts_.size(); ++p)
      parts_[p].lines = static_cast<double>(
          static_cast<Eigen::Index>(p) < of_lines
              ? frf_.lines()
              : std::min(kRun, frf_.lines() - kRun * (static_cast<Eigen::Index>(p) - of_lines)));
    for (Eigen::Index k = 0; !all_count && k < frf_.lines(); ++k) {
      Eigen::VectorXd seen = Eigen::VectorXd::Zero(std::ssize(parts_));
      for (Eigen::Index c = own; c < own + count; ++c)
        if (entry_counts(c, k))
          for (const std::size_t p : parts_of(c, k)) seen[static_cast<Eigen::Index>(p)] = 1.0;
      seen = frf_.team->sum(channel_tiles(share_.size()), seen.size(), {seen});
      for (std::size_t p = 0; p < parts_.size(); ++p)
        parts_[p].lines += seen[static_cast<Eigen::Index>(p)] > 0.0 ? 1.0 : 0.0;
    }
  }

  /// The sums of add_line() for the channels of a tile as numbers, `size()` in all: those of the few parts that they
  /// belong to, in the order of add_sums().
  Eigen::RowVectorXd take_sums(DataRange tile) {
    Eigen::RowVectorXd sums = Eigen::RowVectorXd::Zero(size());
    Eigen::Index at = 0;
    for (const std::size_t p : parts_of(tile)) {
      Part& part = parts_[p];
      sums.segment<3>(at) << part.t, part.r, part.entries;
      part.t = part.r = part.entries = 0.0;
      at += 3;
    }
    return sums;
  }
  void add_sums(DataRange tile, const Eigen::RowVectorXd& sums) {
    Eigen::Index at = 0;
    for (const std::size_t p : parts_of(tile)) {
      parts_[p].t += sums[at++];
      parts_[p].r += sums[at++];
      parts_[p].entries += sums[at++];
    }
  }
  Eigen::Index size() const {
    const Eigen::Index channels = std::min(kTileChannels, share_.size());
    const Eigen::Index runs = (frf_.lines() + kRun - 1) / kRun;
    return 3 *
           (1 + std::min(channels, frf_.n_outputs()) + std::min(channels, frf_.n_inputs()) + runs);
  }

  const Part& all() const { return parts_.front(); }

  /// The mean of r if the error is noise; 0: infinite.
  double expected() const { return dof_ > 1.0 ? dof_ / (dof_ - 1.0) : dof_ > 0.0 ? 0.0 : 1.0; }

  /// The unexplained part to report: all data if unexplained, else the worst; null: all parts are explained.
  const Part* unexplained() const {
    if (is_unexplained(all())) return &all();
    const Part* worst = nullptr;
    for (const Part& part : parts_)
      if (is_unexplained(part) && (worst == nullptr || part.mean_t() > worst->mean_t()))
        worst = &part;
    return worst;
  }

  /// "the residual is 177 times what noise explains, most of it at output z1".
  std::string reason(const Part& part, const char* causes) const {
    const Part* worst = &part;
    if (&part == &all())
      for (const Part& other : parts_)
        if (other.mean_t() > worst->mean_t()) worst = &other;
    const char* preposition = worst == &all() ? "" : worst == &part ? " at " : ", most of it at ";
    return fmt::format("the residual is {:.3g} times what {}{}{}", excess(part), causes,
                       preposition, worst->place);
  }

 private:
  /// A variance of zero is unknown.
  static bool counts(double variance, double weight) { return variance > 0.0 && weight > 0.0; }

  std::array<std::size_t, 4> parts_of(Eigen::Index c, Eigen::Index k) const {
    const Eigen::Index n_y = frf_.n_outputs();
    const Eigen::Index inputs = 1 + n_y;
    const Eigen::Index runs = inputs + frf_.n_inputs();
    return {0, static_cast<std::size_t>(1 + c % n_y), static_cast<std::size_t>(inputs + c / n_y),
            static_cast<std::size_t>(runs + k / kRun)};
  }

  /// The parts to which the channels of a tile belong, in order.
  std::vector<std::size_t> parts_of(DataRange tile) const {
    std::vector<std::size_t> out;
    for (Eigen::Index c = tile.first; c < tile.first + tile.count; ++c)
      for (const std::size_t p : parts_of(c, 0)) out.push_back(p);
    for (Eigen::Index k = 0; k < frf_.lines(); k += kRun) out.push_back(parts_of(0, k)[3]);
    std::ranges::sort(out);
    out.erase(std::ranges::unique(out).begin(), out.end());
    return out;
  }

  /// If r has no mean, the mean of t is used as size of the excess.
  double excess(const Part& part) const {
    return expected() > 0.0 ? part.mean_r() / expected() : kAllowed * part.mean_t();
  }

  bool is_unexplained(const Part& part) const {
    if (!(part.mean_t() > 1.0)) return false;
    if (!std::isfinite(part.mean_t())) return true;
    // The sum of n exponential numbers is half a chi-square variable with 2 n degrees of freedom.
    const double n = std::max(1.0, part.lines / frf_.correlated_lines);
    return tail_of_chi_square(2.0 * n * part.mean_t(), 2.0 * n) *
               static_cast<double>(parts_.size()) <
           kByChance;
  }

  const FrfEstimate& frf_;
  double dof_;
  Eigen::VectorXd rounding_;  // of every line
  Eigen::VectorXd share_;     // of every channel: they may have different units
  std::vector<Part> parts_;
};

constexpr Eigen::Index kTile = 64;  // lines

/// The residual of some channels, line tile by line tile: use(block, E).
template <typename Use>
void for_each_residual(const FrfEstimate& frf, const ModelBlockResponse& model,
                       const DataRange& channels, const Use& use) {
  for (Eigen::Index first = 0, count = 0; first < frf.lines(); first += count) {
    count = frf.lines() - first;
    if (count >= 2 * kTile) count = kTile;  // the last tile has enough lines for a scatter
    const ResponseBlock block{channels.first, channels.count, first, count};
    use(block, Eigen::MatrixXcd(frf.response.block(channels.first, first, channels.count, count) -
                                model(block)));
  }
}

/// Judges by one variance of the data, n_c x N, with so many degrees of freedom; tiles of channels are summed by a team.
ResidualVerdict judge_by(const FrfEstimate& frf, const ModelBlockResponse& model,
                         const Eigen::MatrixXd& weights, ResidualVariance kind, double dof,
                         const Eigen::MatrixXd& variance, const char* causes, const Team& team) {
  ResidualVerdict verdict;
  verdict.variance = kind;
  verdict.dof = dof;
  Parts parts(frf, dof);
  const Eigen::MatrixXd none(0, frf.lines());
  const Eigen::MatrixXd& W = weights.size() > 0 ? weights : none;
  const Eigen::Index tiles = channel_tiles(frf.response.rows());
  Eigen::MatrixXd sums(tiles, parts.size());
  for_each_own_tile(team, frf.response.rows(), [&](const DataRange& channels) {
    for_each_residual(frf, model, channels, [&](const ResponseBlock& block, const auto& E) {
      for (Eigen::Index i = 0; i < block.lines; ++i) {
        const Eigen::Index k = block.first_line + i;
        parts.add_line(
            k, channels.first, E.col(i), variance.col(k).segment(channels.first, channels.count),
            W.col(k).segment(W.rows() > 0 ? channels.first : 0, W.rows() > 0 ? channels.count : 0));
      }
    });
    sums.row(channels.first / kTileChannels) = parts.take_sums(channels);
  });
  team.gather_rows(1, sums);
  for (Eigen::Index t = 0; t < tiles; ++t)
    parts.add_sums(channels_of_tile(t, frf.response.rows()), sums.row(t));
  parts.count_lines(variance, W);
  verdict.chi_square = parts.all().mean_r();
  verdict.expected = parts.expected();
  const Part* unexplained = parts.unexplained();
  verdict.explained = unexplained == nullptr;
  verdict.reason = verdict.explained ? "" : parts.reason(*unexplained, causes);
  return verdict;
}

/// For data without variances: their variance is the scatter of the residual from line to line. What a model misses is
/// smooth.
ResidualVerdict judge_by_itself(const FrfEstimate& frf, const ModelBlockResponse& model,
                                const Eigen::MatrixXd& weights, int threads, const Team& team) {
  if (!has_line_scatter(frf.lines())) return {};
  Eigen::MatrixXd scatter(frf.response.rows(), frf.lines());
  for_each_own_tile(*frf.team, frf.response.rows(), [&](const DataRange& tile) {
    for_each_residual(frf, model, tile, [&](const ResponseBlock& block, const auto& E) {
      scatter.block(tile.first, block.first_line, tile.count, block.lines) =
          scatter_variance(frf.frequency_hz.segment(block.first_line, block.lines), E, threads);
    });
  });
  ResidualVerdict verdict = judge_by(frf, model, weights, ResidualVariance::scatter, kScatterDof,
                                     scatter, "neighbouring lines differ by", team);
  verdict.scatter = std::move(scatter);
  return verdict;
}

}  // namespace

ResidualVerdict judge_residual(const FrfEstimate& frf, const ModelBlockResponse& model,
                               const Eigen::MatrixXd& weights, int threads, const Distortion& known,
                               const Team* of_processes) {
  const Team& team = of_processes != nullptr ? *of_processes : *frf.team;
  if (weights.size() > 0 &&
      (weights.rows() != frf.response.rows() || weights.cols() != frf.response.cols()))
    fail_request("residual: the weights must have the shape of the response");
  const auto judge_with = [&](ResidualVariance kind, const Eigen::MatrixXd& variance, double dof) {
    return judge_by(
        frf, model, weights, kind, dof, variance,
        kind == ResidualVariance::noise ? "noise explains" : "noise and distortion explain", team);
  };
  const bool has_noise = frf.noise_variance.size() > 0;
  const bool has_total = frf.total_variance.size() > 0;
  ResidualVerdict verdict;
  if (has_noise) verdict = judge_with(ResidualVariance::noise, frf.noise_variance, frf.noise_dof);
  if (verdict.explained && has_noise) return verdict;
  if (has_total) {
    ResidualVerdict total = judge_with(ResidualVariance::total, frf.total_variance, frf.total_dof);
    return total.explained || !has_noise ? total : verdict;
  }
  if (!has_noise) return judge_by_itself(frf, model, weights, threads, team);
  if (known.level.cols() > 0 && known.level.rows() == frf.response.rows()) {
    Eigen::MatrixXd variance = variance_with(known, frf);
    ResidualVerdict distorted = judge_with(ResidualVariance::total, variance, frf.noise_dof);
    if (distorted.explained) {
      distorted.scatter = std::move(variance);
      return distorted;
    }
  }
  LineScatter lines = line_scatter(frf, threads);
  if (!lines.shows_distortion() || lines_are_coarse(frf, lines, threads)) return verdict;
  ResidualVerdict scatter = judge_with(ResidualVariance::scatter, lines.variance, lines.dof);
  if (!scatter.explained) return verdict;
  scatter.scatter = std::move(lines.variance);
  return scatter;
}

}  // namespace stageid
