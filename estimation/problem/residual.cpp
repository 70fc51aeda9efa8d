#include "estimation/problem/residual.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kTileEntries = 1 << 18;

/// re, im -= B F^T on as many lines as they have, starting at `first`.
void subtract_model(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                    const Eigen::MatrixXd& B, Eigen::Index first, Eigen::MatrixXd& re,
                    Eigen::MatrixXd& im) {
  const Eigen::Index lines = re.cols();
  for (const BasisGroup& group : groups) {
    const auto F_re = group.F.re.middleRows(first, lines);
    const auto F_im = group.F.im.middleRows(first, lines);
    const bool all = group.channels.size() == static_cast<std::size_t>(problem.channels());
    if (all) {
      re.noalias() -= B * F_re.transpose();
      im.noalias() -= B * F_im.transpose();
    } else {
      for (const Eigen::Index c : group.channels) {
        re.row(c) -= (F_re * B.row(c).transpose()).transpose();
        im.row(c) -= (F_im * B.row(c).transpose()).transpose();
      }
    }
  }
}

/// All channels on some lines; tiles depend on sizes only, never on the number of threads.
std::vector<IndexRange> line_tiles(const FitProblem& problem) {
  return ranges_of(problem.size(), std::max<Eigen::Index>(1, kTileEntries / problem.channels()));
}

/// Memory reused for the data or residual of one tile after another.
class TileMemory {
 public:
  void load_residual(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                     const Eigen::MatrixXd& B, IndexRange tile) {
    re = problem.G->middleCols(tile.first, tile.count).real();
    im = problem.G->middleCols(tile.first, tile.count).imag();
    subtract_model(problem, groups, B, tile.first, re, im);
  }
  /// sum W (re^2 + im^2)
  double squares(const FitProblem& problem, IndexRange tile) const {
    const auto W = problem.W->middleCols(tile.first, tile.count).array();
    return (W * (re.array().square() + im.array().square())).sum();
  }

  Eigen::MatrixXd re;
  Eigen::MatrixXd im;
};

}  // namespace

Residual residual(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                  const Eigen::MatrixXd& B) {
  const IndexRange all{0, problem.size()};
  TileMemory E;
  E.load_residual(problem, groups, B, all);
  const double cost = E.squares(problem, all) / (2.0 * static_cast<double>(problem.size()));
  return {std::move(E.re), std::move(E.im), cost};
}

double residual_cost(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                     const Eigen::MatrixXd& B) {
  const std::vector<IndexRange> tiles = line_tiles(problem);
  std::vector<double> squares(tiles.size());
  for_each_task(problem.threads, static_cast<int>(tiles.size()), [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    TileMemory E;
    E.load_residual(problem, groups, B, tiles[at]);
    squares[at] = E.squares(problem, tiles[at]);
  });
  double sum = 0.0;
  for (const double of_tile : squares) sum += of_tile;
  return sum / (2.0 * static_cast<double>(problem.size()));
}

ResidualSize residual_size(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                           const Eigen::MatrixXd& B, const ChannelFlags& responding) {
  ResidualSize out;
  double sum = 0.0;
  Eigen::Index count = 0;
  TileMemory E;
  for (const IndexRange tile : line_tiles(problem)) {
    E.load_residual(problem, groups, B, tile);
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
