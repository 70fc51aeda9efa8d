#include "estimation/equations/sigma_equations.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "estimation/equations/triangles.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "estimation/products/fraction_gram.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

constexpr double kPathShare = 0.5;
constexpr int kShares = 8;
constexpr Eigen::Index kTimesOver = 3;
constexpr double kShift = 1e-13;  // makes Gram matrices of unit columns factorizable

Eigen::VectorXd inverse_root(const Eigen::VectorXd& diagonal) {
  return diagonal.cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
}

/// H of the own channels. Tiles are evaluated before they are copied, because the ends of vectors round complex products
/// differently.
Eigen::MatrixXcd divided(const Eigen::MatrixXcd& G, const Eigen::VectorXcd& factor,
                         const Team& team) {
  Eigen::MatrixXcd H(G.rows(), G.cols());
  for_each_own_tile(team, G.rows(), [&](DataRange tile) {
    const Eigen::MatrixXcd of_tile =
        G.middleRows(tile.first, tile.count) * factor.cwiseInverse().asDiagonal();
    H.middleRows(tile.first, tile.count) = of_tile;
  });
  return H;
}

/// Fraction of the path up to each line: kPathShare by the change of log H over all channels, the rest by line index.
Eigen::VectorXd path_of(const Eigen::MatrixXcd& H, const Team& team) {
  const Eigen::Index last = H.cols() - 1;
  const Eigen::VectorXd steps = sum_over_tiles(team, H.rows(), H.cols(), [&](DataRange tile) {
    Eigen::VectorXd part = Eigen::VectorXd::Zero(H.cols());
    for (Eigen::Index k = 1; k <= last; ++k)
      for (Eigen::Index c = tile.first; c < tile.first + tile.count; ++c) {
        const double turn = std::abs(std::log(H(c, k) / H(c, k - 1)));
        if (std::isfinite(turn)) part[k] += turn;
      }
    return part;
  });
  Eigen::VectorXd path = Eigen::VectorXd::Zero(H.cols());
  for (Eigen::Index k = 1; k <= last; ++k) path[k] = path[k - 1] + steps[k];
  return kPathShare / std::max(path[last], 1e-300) * path +
         (1.0 - kPathShare) * Eigen::VectorXd::LinSpaced(H.cols(), 0.0, 1.0);
}

/// The lower right corner of R, n+1 x n+1, in  sqrt(w) [phi, own | -H phi, -H] = Q R: the equations of the channel
/// after elimination of its numerators.
Eigen::MatrixXd factor_of_channel(const Eigen::VectorXd& weights, const Eigen::VectorXcd& response,
                                  const SplitMatrix& phi, const SplitMatrix& own) {
  const Eigen::Index N = response.size();
  const Eigen::Index n = phi.cols();
  const Eigen::Index numerators = n + own.cols();
  const Eigen::ArrayXd w = weights.cwiseSqrt().array();
  const Eigen::ArrayXcd H = response.array();
  const Eigen::ArrayXd h_re = -w * H.real();
  const Eigen::ArrayXd h_im = -w * H.imag();
  Eigen::MatrixXd A(2 * N, numerators + n + 1);
  A.topLeftCorner(N, n) = phi.re.array().colwise() * w;
  A.bottomLeftCorner(N, n) = phi.im.array().colwise() * w;
  A.block(0, n, N, own.cols()) = own.re.array().colwise() * w;
  A.block(N, n, N, own.cols()) = own.im.array().colwise() * w;
  A.block(0, numerators, N, n) = phi.re.array().colwise() * h_re - phi.im.array().colwise() * h_im;
  A.block(N, numerators, N, n) = phi.re.array().colwise() * h_im + phi.im.array().colwise() * h_re;
  A.rightCols(1) << h_re.matrix(), h_im.matrix();
  return triangle_after(numerators, A);
}

/// sum_k Re{conj(X) v}, one per column of X
Eigen::VectorXd sum(const SplitMatrix& X, const Eigen::VectorXcd& v) {
  return X.re.transpose() * v.real() + X.im.transpose() * v.imag();
}

/// Products of sqrt(w) [-H phi, -H] with itself, minus the part explained by sqrt(w) [phi, own].
Eigen::MatrixXd remaining_products(const Eigen::VectorXd& w, const Eigen::VectorXcd& H,
                                   const SplitMatrix& phi, const SplitMatrix& own,
                                   const FractionGram& products) {
  const Eigen::Index n = phi.cols();
  const Eigen::Index left = n + own.cols();
  const Eigen::VectorXcd power = w.cwiseProduct(H.cwiseAbs2()).cast<Complex>();
  const Eigen::VectorXcd wH = w.cwiseProduct(H);
  Eigen::MatrixXd LL(left, left);
  Eigen::MatrixXd LR(left, n + 1);
  Eigen::MatrixXd RR(n + 1, n + 1);
  LL.topLeftCorner(n, n) = products(w.cast<Complex>());
  LR.topLeftCorner(n, n) = products(-wH);
  LR.col(n) << sum(phi, -wH), sum(own, -wH);
  RR.topLeftCorner(n, n) = products(power);
  RR.col(n) << sum(phi, power), power.sum().real();
  RR.row(n) = RR.col(n).transpose();
  for (Eigen::Index o = 0; o < own.cols(); ++o) {
    const Eigen::VectorXcd column =
        own.re.col(o).cast<Complex>() + Complex(0.0, 1.0) * own.im.col(o).cast<Complex>();
    LL.col(n + o) << sum(phi, w.cwiseProduct(column)), sum(own, w.cwiseProduct(column));
    LL.row(n + o) = LL.col(n + o).transpose();
    LR.row(n + o).head(n) = sum(phi, -wH.conjugate().cwiseProduct(column)).transpose();
  }
  const Eigen::VectorXd scale = inverse_root(LL.diagonal());
  LL = scale.asDiagonal() * LL * scale.asDiagonal();
  LL.diagonal().array() += kShift;
  LR = scale.asDiagonal() * LR;
  LL.llt().matrixL().solveInPlace(LR);
  return RR - LR.transpose() * LR;
}

}  // namespace

SigmaEquations::SigmaEquations(Eigen::VectorXcd x, bool unit_circle, const Eigen::MatrixXcd& G,
                               const Eigen::VectorXcd& factor, const Eigen::MatrixXd& weights,
                               SplitMatrix own, const Workers& workers)
    : x_(std::move(x)),
      unit_circle_(unit_circle),
      H_(divided(G, factor, *workers.team)),
      path_(path_of(H_, *workers.team)),
      power_(factor.cwiseAbs2()),
      weights_(weights),
      own_(std::move(own)),
      workers_(workers) {}

Eigen::MatrixXd SigmaEquations::triangle(const PoleSet& poles, bool accurate) const {
  const SplitMatrix phi = partial_fractions(poles, x_);
  if (!accurate)
    if (std::optional<Eigen::MatrixXd> R = by_sums(poles, phi)) return *std::move(R);
  return by_factors(phi);
}

/// About `count` lines at equal steps of the path; after a steep one, all lines until their number is made up.
std::vector<Eigen::Index> SigmaEquations::representative(Eigen::Index count) const {
  std::vector<Eigen::Index> lines;
  double next = 0.0;
  for (Eigen::Index k = 0; k < x_.size(); ++k) {
    if (path_[k] < next && x_.size() > count) continue;
    lines.push_back(k);
    next += 1.0 / static_cast<double>(count);
  }
  return lines;
}

/// Data that need this path are nearly exact, so a few times as many lines as unknowns suffice.
Eigen::MatrixXd SigmaEquations::by_factors(const SplitMatrix& phi) const {
  const Eigen::Index unknowns = 2 * phi.cols() + own_.cols() + 1;
  const std::vector<Eigen::Index> lines = representative(kTimesOver * unknowns / 2);
  const auto thinned = [&](const SplitMatrix& all) {
    return SplitMatrix{all.re(lines, Eigen::all), all.im(lines, Eigen::all)};
  };
  const SplitMatrix thin_phi = thinned(phi);
  const SplitMatrix thin_own = thinned(own_);
  const Eigen::VectorXd thin_power = power_(lines);
  const auto triangle_of = [&](Eigen::Index c) {
    const Eigen::VectorXd weight = weights_.row(c)(lines).transpose();
    const Eigen::VectorXcd response = H_.row(c)(lines).transpose();
    return factor_of_channel(weight.cwiseProduct(thin_power), response, thin_phi, thin_own);
  };
  return stacked_triangle(H_.rows(), workers_, triangle_of) *
         std::sqrt(static_cast<double>(x_.size()) / static_cast<double>(lines.size()));
}

/// From products of fractions. @returns nothing if too few digits remain
std::optional<Eigen::MatrixXd> SigmaEquations::by_sums(const PoleSet& poles,
                                                       const SplitMatrix& phi) const {
  const Eigen::Index n = phi.cols();
  const FractionGram products(poles, x_, unit_circle_);
  const auto of_tile = [&](DataRange tile) {
    std::vector<Eigen::MatrixXd> shares(kShares);
    for_each_task(workers_.threads, kShares, [&](int share) {
      Eigen::MatrixXd S = Eigen::MatrixXd::Zero(n + 1, n + 1);
      for (Eigen::Index c = tile.first + share; c < tile.first + tile.count; c += kShares)
        S += remaining_products(weights_.row(c).transpose().cwiseProduct(power_),
                                H_.row(c).transpose(), phi, own_, products);
      shares[share] = S;
    });
    for (int share = 1; share < kShares; ++share) shares[0] += shares[share];
    return Eigen::VectorXd(shares[0].reshaped());
  };
  const Eigen::MatrixXd S =
      sum_over_tiles(*workers_.team, H_.rows(), (n + 1) * (n + 1), of_tile).reshaped(n + 1, n + 1);
  const Eigen::VectorXd scale = inverse_root(S.diagonal());
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Upper> factor(scale.asDiagonal() * S *
                                                         scale.asDiagonal());
  if (factor.info() != Eigen::Success) return std::nullopt;
  const Eigen::MatrixXd R = factor.matrixU();
  return R * scale.cwiseInverse().asDiagonal();
}

}  // namespace stageid
