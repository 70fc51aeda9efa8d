#include "estimation/problem/residual.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stageid {
namespace {

constexpr Eigen::Index kTileEntries = 1 << 18;

/// E = G - P of some channels on some lines, in memory that can be used again.
void load_residual(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                   const Eigen::MatrixXd& B, DataRange channels, DataRange lines, SplitMatrix& E) {
  const auto G = problem.G->block(channels.first, lines.first, channels.count, lines.count);
  E.re = G.real();
  E.im = G.imag();
  for (const BasisGroup& group : groups) {
    const auto F_re = group.F.re.middleRows(lines.first, lines.count);
    const auto F_im = group.F.im.middleRows(lines.first, lines.count);
    const bool all = group.channels.size() == static_cast<std::size_t>(problem.channels());
    if (all) {
      E.re.noalias() -= B.middleRows(channels.first, channels.count) * F_re.transpose();
      E.im.noalias() -= B.middleRows(channels.first, channels.count) * F_im.transpose();
    } else {
      for (const Eigen::Index c : group.channels) {
        const Eigen::Index r = c - channels.first;
        if (r < 0 || r >= channels.count) continue;
        E.re.row(r) -= (F_re * B.row(c).transpose()).transpose();
        E.im.row(r) -= (F_im * B.row(c).transpose()).transpose();
      }
    }
  }
}

/// So many channels on some lines; tiles depend on sizes only, never on the number of threads.
std::vector<DataRange> line_tiles(const FitProblem& problem, Eigen::Index channels) {
  return ranges_of(problem.size(), std::max<Eigen::Index>(1, kTileEntries / channels));
}

}  // namespace

SplitMatrix residual(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                     const Eigen::MatrixXd& B) {
  SplitMatrix E;
  load_residual(problem, groups, B, {0, problem.channels()}, {0, problem.size()}, E);
  return E;
}

double residual_cost(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                     const Eigen::MatrixXd& B) {
  const double squares =
      ordered_sum(line_tiles(problem, problem.channels()), problem.threads, [&](DataRange tile) {
        SplitMatrix E;
        load_residual(problem, groups, B, {0, problem.channels()}, tile, E);
        const auto W = problem.W->middleCols(tile.first, tile.count).array();
        return (W * (E.re.array().square() + E.im.array().square())).sum();
      });
  return squares / (2.0 * static_cast<double>(problem.size()));
}

ResidualSize residual_size(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                           const Eigen::MatrixXd& B, const ChannelFlags& responding) {
  enum : Eigen::Index { kSquares, kCount, kInfinite, kNumbers };
  const auto of_channels = [&](DataRange channels) {
    Eigen::VectorXd part = Eigen::VectorXd::Zero(kNumbers);
    SplitMatrix E;
    for (const DataRange lines : line_tiles(problem, channels.count)) {
      load_residual(problem, groups, B, channels, lines, E);
      if (!E.re.allFinite() || !E.im.allFinite()) part[kInfinite] = 1.0;
      for (Eigen::Index k = 0; k < lines.count; ++k)
        for (Eigen::Index r = 0; r < channels.count; ++r) {
          const Eigen::Index c = channels.first + r;
          const double power = std::norm((*problem.G)(c, lines.first + k));
          if (!responding[c] || !(power > 0.0)) continue;
          part[kSquares] += (E.re(r, k) * E.re(r, k) + E.im(r, k) * E.im(r, k)) / power;
          part[kCount] += 1.0;
        }
    }
    return part;
  };
  const Eigen::VectorXd sum =
      sum_over_tiles(*problem.team, problem.channels(), kNumbers, of_channels);
  return {sum[kCount] > 0.0 ? std::sqrt(sum[kSquares] / sum[kCount])
                            : std::numeric_limits<double>::quiet_NaN(),
          sum[kInfinite] == 0.0};
}

}  // namespace stageid
