#include "estimation/equations/numerators.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/factored_equations.hpp"
#include "estimation/products/weighted_products.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

constexpr double kSlightGain = 1e-3;

/// sums += sum Re{conj(F) W E} of a tile.
void add_weighted_gradient(const BasisGroup& group, Eigen::Index first, const DataTile& data,
                           Eigen::MatrixXd& sums) {
  const Eigen::Index n = data.W.cols();
  const Eigen::MatrixXd WE_re = data.W.cwiseProduct(data.E_re);
  const Eigen::MatrixXd WE_im = data.W.cwiseProduct(data.E_im);
  sums.noalias() += group.F.re.middleRows(first, n).transpose() * WE_re.transpose();
  sums.noalias() += group.F.im.middleRows(first, n).transpose() * WE_im.transpose();
}

/// Sums over the lines of a block of channels; one column per channel.
struct NumeratorSums {
  Eigen::MatrixXd FF;    ///< triangle x members: sum W Re{conj(F_i) F_j}; if requested
  Eigen::MatrixXd S;     ///< members x base columns: sum W |first|^2 base; see PairReduction
  Eigen::MatrixXd FE;    ///< n_f x members: sum Re{conj(F) W E}
  double squares = 0.0;  ///< sum W |E|^2
  NumeratorSums& operator+=(const NumeratorSums& other) {
    FF += other.FF;
    S += other.S;
    FE += other.FE;
    squares += other.squares;
    return *this;
  }
};

/// The sums without FF and S. @param B numerators, members x n_f
NumeratorSums residual_sums(const FitProblem& problem, const BasisGroup& group,
                            const TileRange& block, const Eigen::MatrixXd& B) {
  return ordered_sum(line_shares(block), problem.threads, [&](const TileRange& share) {
    NumeratorSums sums;
    sums.FE.setZero(problem.functions(), share.members);
    DataTile data;
    for_each_tile(share, [&](Eigen::Index first, Eigen::Index n) {
      data.load(problem, group, share, B, first, n);
      sums.squares += data.squares();
      add_weighted_gradient(group, first, data, sums.FE);
    });
    return sums;
  });
}

/// The sums for numerators of zero.
NumeratorSums gram_sums(const FitProblem& problem, const BasisGroup& group,
                        const PairReduction& pairs, const TileRange& block) {
  const auto add = [&](const TileRange& share) {
    NumeratorSums sums;
    sums.FF.setZero(std::ssize(pairs.direct()), share.members);
    sums.FE.setZero(problem.functions(), share.members);
    sums.S.setZero(share.members, group.fractions.simple_columns());
    DataTile data;
    for_each_tile(share, [&](Eigen::Index first, Eigen::Index n) {
      data.load(problem, group, share, {}, first, n);
      add_pair_sums(data.W, group.F, group.F, pairs.direct(), first, sums.FF);
      add_fraction_sums(data.W, group.fractions, first, sums.S);
      add_weighted_gradient(group, first, data, sums.FE);
    });
    return sums;
  };
  NumeratorSums all = ordered_sum(line_shares(block), problem.threads, add);
  all.FF = pairs.expand(all.S, all.FF, problem.threads);
  return all;
}

std::vector<ScaledNormalEquations> normal_equations(const Eigen::MatrixXd& FF, Eigen::Index n_f) {
  std::vector<ScaledNormalEquations> out;
  out.reserve(FF.cols());
  for (Eigen::Index c = 0; c < FF.cols(); ++c) out.emplace_back(from_triangle(FF.col(c), n_f));
  return out;
}

enum class Digits : std::uint8_t { none, few, enough };

/// A block's numerators, members x n_f, and its sum W |E|^2, from sums.
///
/// The first solution is refined with its residual. The refinement d lowers the squares by exactly FE . d, because they
/// are quadratic. If that is a visible part of them, the sums have lost the digits that the residual consists of.
Digits solve_by_sums(const FitProblem& problem, const BasisGroup& group, const PairReduction& pairs,
                     const TileRange& block, Eigen::MatrixXd& B, double& squares) {
  const NumeratorSums gram = gram_sums(problem, group, pairs, block);
  const std::vector<ScaledNormalEquations> factors = normal_equations(gram.FF, problem.functions());
  for (const ScaledNormalEquations& channel : factors)
    if (!channel.ok()) return Digits::none;
  const auto solve = [&](const Eigen::MatrixXd& right_sides) {
    Eigen::MatrixXd out(block.members, problem.functions());
    for (Eigen::Index r = 0; r < block.members; ++r)
      out.row(r) = factors[r].solve(right_sides.col(r)).transpose();
    return out;
  };
  B = solve(gram.FE);
  const NumeratorSums rest = residual_sums(problem, group, block, B);
  const Eigen::MatrixXd refinement = solve(rest.FE);
  B += refinement;
  const double gain = refinement.cwiseProduct(rest.FE.transpose()).sum();
  squares = rest.squares - gain;
  return std::abs(gain) <= kSlightGain * rest.squares ? Digits::enough : Digits::few;
}

/// Calls visit(i, C_i^-1) for every submodel of a channel with the normal equations M. C_i is the block of M^-1 of the
/// submodel.
template <typename Visit>
void visit_submodels(const FitProblem& problem, const Eigen::MatrixXd& M, Visit visit) {
  const Eigen::Index n_f = problem.functions();
  const ScaledNormalEquations factor(M);
  if (!factor.ok()) return;
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(n_f, n_f));
  Eigen::Index f = 0;
  for (std::size_t i = 0; i < problem.shapes.size(); ++i) {
    const Eigen::Index n = problem.shapes[i].functions();
    const Eigen::MatrixXd C = inverse.block(f, f, n, n);
    visit(i, f, Eigen::MatrixXd(C.llt().solve(Eigen::MatrixXd::Identity(n, n))));
    f += n;
  }
}

/// Calls visit(group, pairs, block) for its own channels in blocks.
template <typename Visit>
void visit_blocks(const FitProblem& problem, const BasisGroups& groups, Visit visit) {
  const DataRange own = own_channels(*problem.team, problem.channels());
  groups.for_each([&](const BasisGroup& group) {
    // The products of all functions, shared by all blocks.
    const PairReduction pairs(group.fractions, group.fractions.F, group.fractions.F,
                              triangular_pairs(problem.functions()));
    for (const TileRange& block : member_blocks(group, own, problem.size()))
      visit(group, pairs, block);
  });
}

/// Calls visit(c, M) for every own channel with its normal equations, the members of a block in parallel.
template <typename Visit>
void visit_channels(const FitProblem& problem, const BasisGroups& groups, Visit visit) {
  visit_blocks(problem, groups, [&](const auto& group, const auto& pairs, const auto& block) {
    const Eigen::MatrixXd FF = gram_sums(problem, group, pairs, block).FF;
    for_each_task(problem.threads, static_cast<int>(FF.cols()), [&](int r) {
      visit(group.channels[block.first_member + r], from_triangle(FF.col(r), problem.functions()));
    });
  });
}

}  // namespace

std::optional<SolvedNumerators> solve_numerators(const FitProblem& problem,
                                                 const BasisGroups& groups, Eigen::MatrixXd& B) {
  B.setZero(problem.channels(), problem.functions());
  const Eigen::Index tiles = channel_tiles(problem.channels());
  const TileShare own = problem.team->share(tiles);
  enum : Eigen::Index { kSquares, kTried, kByFactors, kFailed, kNumbers };
  std::vector<Eigen::VectorXd> parts(own.count, Eigen::VectorXd::Zero(kNumbers));
  Eigen::MatrixXd of_block;
  Eigen::MatrixXd by_factors;
  const auto solve = [&](const auto& group, const auto& pairs, const auto& block) {
    const Eigen::Index tile = group.channels[block.first_member] / kTileChannels;
    Eigen::VectorXd& part = parts[tile - own.first];
    if (part[kFailed] > 0.0) return;
    double squares = 0.0;
    const Digits digits = solve_by_sums(problem, group, pairs, block, of_block, squares);
    if (digits != Digits::enough) {
      double squares_by_factors = 0.0;
      part[kTried] += static_cast<double>(block.members);
      if (factored_numerators(problem, group, block, by_factors, squares_by_factors)) {
        part[kByFactors] += 1.0;
        of_block.swap(by_factors);
        squares = squares_by_factors;
      } else if (digits == Digits::none) {
        part[kFailed] += 1.0;
        return;
      } else {
        squares = residual_sums(problem, group, block, of_block).squares;
      }
    }
    part[kSquares] += squares;
    for (Eigen::Index r = 0; r < block.members; ++r)
      B.row(group.channels[block.first_member + r]) = of_block.row(r);
  };
  visit_blocks(problem, groups, solve);
  const Eigen::VectorXd sum = problem.team->sum(tiles, kNumbers, parts);
  if (sum[kTried] > 0.0) add_work_of_factors(problem, sum[kTried]);
  if (sum[kFailed] > 0.0) return std::nullopt;
  const SolvedNumerators out{sum[kSquares] / (2.0 * static_cast<double>(problem.size())),
                             sum[kByFactors] > 0.0};
  return std::isfinite(out.cost) ? std::optional(out) : std::nullopt;
}

void gather_numerators(const FitProblem& problem, Eigen::MatrixXd& B) {
  problem.team->gather_rows(kTileChannels, B);
}

std::vector<double> removal_costs(const FitProblem& problem, const BasisGroups& groups,
                                  const Eigen::MatrixXd& B) {
  Eigen::MatrixXd costs = Eigen::MatrixXd::Zero(std::ssize(problem.shapes), problem.channels());
  visit_channels(problem, groups, [&](Eigen::Index c, const Eigen::MatrixXd& M) {
    visit_submodels(problem, M, [&](std::size_t i, Eigen::Index f, const Eigen::MatrixXd& inverse) {
      const Eigen::VectorXd b = B.row(c).segment(f, inverse.cols()).transpose();
      costs(static_cast<Eigen::Index>(i), c) = b.dot(inverse * b);
    });
  });
  const Eigen::VectorXd sum =
      sum_over_tiles(*problem.team, problem.channels(), costs.rows(), [&](DataRange tile) {
        Eigen::VectorXd part = Eigen::VectorXd::Zero(costs.rows());
        for (Eigen::Index c = tile.first; c < tile.first + tile.count; ++c) part += costs.col(c);
        return part;
      });
  return {sum.begin(), sum.end()};
}

double shrink_numerators(const FitProblem& problem, const BasisGroups& groups,
                         const std::vector<double>& share, Eigen::MatrixXd& B) {
  Eigen::VectorXd rise = Eigen::VectorXd::Zero(problem.channels());
  visit_channels(problem, groups, [&](Eigen::Index c, const Eigen::MatrixXd& M) {
    Eigen::MatrixXd penalty = Eigen::MatrixXd::Zero(M.rows(), M.cols());
    visit_submodels(problem, M, [&](std::size_t i, Eigen::Index f, const Eigen::MatrixXd& inverse) {
      penalty.block(f, f, inverse.rows(), inverse.cols()) = share[i] / (1.0 - share[i]) * inverse;
    });
    const ScaledNormalEquations penalized(M + penalty);
    if (!penalized.ok()) return;
    const Eigen::VectorXd change = penalized.solve(-penalty * B.row(c).transpose());
    rise[c] = change.dot(M * change);
    B.row(c) += change.transpose();
  });
  gather_numerators(problem, B);
  return sum_over_tiles(*problem.team, problem.channels(), 1, [&](DataRange tile) {
    return Eigen::VectorXd::Constant(1, rise.segment(tile.first, tile.count).sum()).eval();
  })[0];
}

}  // namespace stageid
