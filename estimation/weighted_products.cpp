#include "estimation/weighted_products.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kTileLines = 256;   // W's tile and the products' tile stay in the cache
constexpr Eigen::Index kBlockPairs = 192;  // pairs a task

}  // namespace

std::vector<ColumnPair> triangular_pairs(Eigen::Index n) {
  std::vector<ColumnPair> pairs;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) pairs.push_back({i, j});
  return pairs;
}

std::vector<ColumnPair> all_pairs(Eigen::Index left, Eigen::Index right) {
  std::vector<ColumnPair> pairs;
  for (Eigen::Index i = 0; i < left; ++i)
    for (Eigen::Index j = 0; j < right; ++j) pairs.push_back({i, j});
  return pairs;
}

void for_each_pair_block(Eigen::Index pairs, Eigen::Index lines, int threads,
                         const PairBlockTask& task) {
  const auto blocks = static_cast<int>((pairs + kBlockPairs - 1) / kBlockPairs);
  parallel_tasks(blocks, threads, [&](int block) {
    const Eigen::Index first = block * kBlockPairs;
    const Eigen::Index count = std::min(kBlockPairs, pairs - first);
    for (Eigen::Index k = 0; k < lines; k += kTileLines)
      task(first, count, k, std::min(kTileLines, lines - k));
  });
}

Eigen::MatrixXd weighted_pair_sums(const Eigen::MatrixXd& W, const ComplexColumns& X,
                                   const ComplexColumns& Y, const std::vector<ColumnPair>& pairs,
                                   int threads) {
  const auto n_pairs = static_cast<Eigen::Index>(pairs.size());
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(W.rows(), n_pairs);
  for_each_pair_block(n_pairs, W.cols(), threads,
                      [&](Eigen::Index first, Eigen::Index count, Eigen::Index k, Eigen::Index n) {
                        Eigen::MatrixXd products(n, count);
                        for (Eigen::Index p = 0; p < count; ++p) {
                          const auto [i, j] = pairs[static_cast<std::size_t>(first + p)];
                          products.col(p) =
                              X.re.col(i).segment(k, n).cwiseProduct(Y.re.col(j).segment(k, n)) +
                              X.im.col(i).segment(k, n).cwiseProduct(Y.im.col(j).segment(k, n));
                        }
                        sums.middleCols(first, count).noalias() += W.middleCols(k, n) * products;
                      });
  return sums;
}

Eigen::MatrixXd weighted_pair_sums(const ComplexColumns& V, const ComplexColumns& X,
                                   const ComplexColumns& Y, const std::vector<ColumnPair>& pairs,
                                   int threads) {
  const auto n_pairs = static_cast<Eigen::Index>(pairs.size());
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(V.re.rows(), n_pairs);
  for_each_pair_block(n_pairs, V.re.cols(), threads,
                      [&](Eigen::Index first, Eigen::Index count, Eigen::Index k, Eigen::Index n) {
                        Eigen::MatrixXd re(n, count);
                        Eigen::MatrixXd im(n, count);
                        for (Eigen::Index p = 0; p < count; ++p) {
                          const auto [i, j] = pairs[static_cast<std::size_t>(first + p)];
                          const auto x_re = X.re.col(i).segment(k, n);
                          const auto x_im = X.im.col(i).segment(k, n);
                          const auto y_re = Y.re.col(j).segment(k, n);
                          const auto y_im = Y.im.col(j).segment(k, n);
                          re.col(p) = x_re.cwiseProduct(y_re) + x_im.cwiseProduct(y_im);
                          im.col(p) = x_re.cwiseProduct(y_im) - x_im.cwiseProduct(y_re);
                        }
                        sums.middleCols(first, count).noalias() += V.re.middleCols(k, n) * re;
                        sums.middleCols(first, count).noalias() -= V.im.middleCols(k, n) * im;
                      });
  return sums;
}

Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<Eigen::Index>& rows) {
  Eigen::MatrixXd out(static_cast<Eigen::Index>(rows.size()), matrix.cols());
  for (std::size_t r = 0; r < rows.size(); ++r)
    out.row(static_cast<Eigen::Index>(r)) = matrix.row(rows[r]);
  return out;
}

Eigen::MatrixXd numerator_gradient(const FitProblem& problem, const BasisGroup& group,
                                   const Residual& E) {
  const Eigen::MatrixXd W = rows_of(problem.W, group.channels);
  Eigen::MatrixXd e = W.cwiseProduct(rows_of(E.re, group.channels)) * group.F_re;
  e.noalias() += W.cwiseProduct(rows_of(E.im, group.channels)) * group.F_im;
  return e;
}

}  // namespace stageid
