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
      : frf_(frf),
        dof_(dof),
        rounding_(kRounding * frf.response.colwise().squaredNorm().transpose()),
        share_(frf.response.rowwise().squaredNorm()) {
    share_ /= std::max(share_.sum(), std::numeric_limits<double>::min());
    parts_.push_back({});
    for (const std::string& name : frf.outputs.names) parts_.push_back({"output " + name});
    for (const std::string& name : frf.inputs.names) parts_.push_back({"input " + name});
    for (Eigen::Index first = 0; first < frf.lines(); first += kRun) {
      const Eigen::Index last = std::min(first + kRun, frf.lines()) - 1;
      parts_.push_back(
          {fmt::format("{:.4g} to {:.4g} Hz", frf.frequency_hz[first], frf.frequency_hz[last])});
    }
    seen_.resize(parts_.size());
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
  void count_line(Eigen::Index k, const Eigen::Ref<const Eigen::VectorXd>& variance,
                  const Eigen::Ref<const Eigen::VectorXd>& weights) {
    std::fill(seen_.begin(), seen_.end(), false);
    for (Eigen::Index c = 0; c < variance.size(); ++c)
      if (counts(variance[c], weights.size() > 0 ? weights[c] : 1.0))
        for (const std::size_t p : parts_of(c, k)) seen_[p] = true;
    for (std::size_t p = 0; p < parts_.size(); ++p) parts_[p].lines += seen_[p] ? 1.0 : 0.0;
  }

  /// The sums of add_line() as numbers.
  Eigen::VectorXd take_sums() {
    Eigen::VectorXd sums(size());
    for (std::size_t p = 0; p < parts_.size(); ++p) {
      Part& part = parts_[p];
      sums.segment<3>(3 * static_cast<Eigen::Index>(p)) << part.t, part.r, part.entries;
      part.t = part.r = part.entries = 0.0;
    }
    return sums;
  }
  void set_sums(const Eigen::VectorXd& sums) {
    for (std::size_t p = 0; p < parts_.size(); ++p) {
      const auto of_part = sums.segment<3>(3 * static_cast<Eigen::Index>(p));
      parts_[p].t = of_part[0];
      parts_[p].r = of_part[1];
      parts_[p].entries = of_part[2];
    }
  }
  Eigen::Index size() const { return 3 * std::ssize(parts_); }

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
  std::vector<bool> seen_;
};

constexpr Eigen::Index kTile = 64;  // lines

/// The residual of some channels, line tile by line tile: use(block, E).
template <typename Use>
void for_each_residual(const FrfEstimate& frf, const ModelBlockResponse& model,
                       const IndexRange& channels, const Use& use) {
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
  const auto sums = [&](const IndexRange& channels) {
    for_each_residual(frf, model, channels, [&](const ResponseBlock& block, const auto& E) {
      for (Eigen::Index i = 0; i < block.lines; ++i) {
        const Eigen::Index k = block.first_line + i;
        parts.add_line(
            k, channels.first, E.col(i), variance.col(k).segment(channels.first, channels.count),
            W.col(k).segment(W.rows() > 0 ? channels.first : 0, W.rows() > 0 ? channels.count : 0));
      }
    });
    return parts.take_sums();
  };
  parts.set_sums(sum_over_tiles(team, frf.response.rows(), parts.size(), sums));
  for (Eigen::Index k = 0; k < frf.lines(); ++k) parts.count_line(k, variance.col(k), W.col(k));
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
  for_each_residual(
      frf, model, {0, frf.response.rows()}, [&](const ResponseBlock& block, const auto& E) {
        scatter.middleCols(block.first_line, block.lines) =
            scatter_variance(frf.frequency_hz.segment(block.first_line, block.lines), E, threads);
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
  const Team& team = of_processes != nullptr ? *of_processes : Team::one();
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
