#include "estimation/problem/residual.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stageid {
namespace {

constexpr Eigen::Index kTileEntries = 1 << 18;

/// E = G - P on some lines, in memory that can be used again.
void load_residual(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                   const Eigen::MatrixXd& B, IndexRange lines, SplitMatrix& E) {
  E.re = problem.G->middleCols(lines.first, lines.count).real();
  E.im = problem.G->middleCols(lines.first, lines.count).imag();
  for (const BasisGroup& group : groups) {
    const auto F_re = group.F.re.middleRows(lines.first, lines.count);
    const auto F_im = group.F.im.middleRows(lines.first, lines.count);
    const bool all = group.channels.size() == static_cast<std::size_t>(problem.channels());
    if (all) {
      E.re.noalias() -= B * F_re.transpose();
      E.im.noalias() -= B * F_im.transpose();
    } else {
      for (const Eigen::Index c : group.channels) {
        E.re.row(c) -= (F_re * B.row(c).transpose()).transpose();
        E.im.row(c) -= (F_im * B.row(c).transpose()).transpose();
      }
    }
  }
}

/// All channels on some lines; tiles depend on sizes only, never on the number of threads.
std::vector<IndexRange> line_tiles(const FitProblem& problem) {
  return ranges_of(problem.size(), std::max<Eigen::Index>(1, kTileEntries / problem.channels()));
}

}  // namespace

SplitMatrix residual(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                     const Eigen::MatrixXd& B) {
  SplitMatrix E;
  load_residual(problem, groups, B, {0, problem.size()}, E);
  return E;
}

double residual_cost(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                     const Eigen::MatrixXd& B) {
  const double squares = ordered_sum(line_tiles(problem), problem.threads, [&](IndexRange tile) {
    SplitMatrix E;
    load_residual(problem, groups, B, tile, E);
    const auto W = problem.W->middleCols(tile.first, tile.count).array();
    return (W * (E.re.array().square() + E.im.array().square())).sum();
  });
  return squares / (2.0 * static_cast<double>(problem.size()));
}

ResidualSize residual_size(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                           const Eigen::MatrixXd& B, const ChannelFlags& responding) {
  ResidualSize out;
  double sum = 0.0;
  Eigen::Index count = 0;
  SplitMatrix E;
  for (const IndexRange tile : line_tiles(problem)) {
    load_residual(problem, groups, B, tile, E);
    out.finite = out.finite && E.re.allFinite() && E.im.allFinite();
    for (Eigen::Index k = 0; k < tile.count; ++k)
      for (Eigen::Index c = 0; c < problem.channels(); ++c) {
        const double power = std::norm((*problem.G)(c, tile.first + k));
        if (!responding[c] || !(power > 0.0)) continue;
        sum += (E.re(c, k) * E.re(c, k) + E.im(c, k) * E.im(c, k)) / power;
        ++count;
      }
  }
  out.relative_rms = count > 0 ? std::sqrt(sum / static_cast<double>(count))
                               : std::numeric_limits<double>::quiet_NaN();
  return out;
}

}  // namespace stageid
