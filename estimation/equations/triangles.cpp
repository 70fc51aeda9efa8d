#include "estimation/equations/triangles.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "estimation/problem/fit_problem.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/threads/parcel.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kShares = 8;

/// The triangle R of the stacked matrix [R; further] = Q R.
void append(Eigen::MatrixXd& R, const Eigen::MatrixXd& further) {
  Eigen::MatrixXd both(R.rows() + further.rows(), R.cols());
  both << R, further;
  qr_in_place(both);
  R = both.topRows(R.cols()).triangularView<Eigen::Upper>();
}

/// R of the triangles stacked.
Eigen::MatrixXd merged(std::vector<Eigen::MatrixXd> triangles, int threads) {
  while (triangles.size() > 1) {
    const std::size_t pairs = triangles.size() / 2;
    for_each_task(threads, static_cast<int>(pairs), [&](int pair) {
      append(triangles[pair], triangles[triangles.size() - 1 - pair]);
    });
    triangles.resize(triangles.size() - pairs);
  }
  return std::move(triangles.front());
}

}  // namespace

Eigen::MatrixXd triangle_after(Eigen::Index eliminated, Eigen::MatrixXd& A) {
  qr_in_place(A);
  const Eigen::Index rest = A.cols() - eliminated;
  return Eigen::MatrixXd(
      A.block(eliminated, eliminated, rest, rest).triangularView<Eigen::Upper>());
}

Eigen::MatrixXd stacked_triangle(Eigen::Index channels, const Workers& workers,
                                 const std::function<Eigen::MatrixXd(Eigen::Index)>& factor) {
  std::vector<Eigen::MatrixXd> tiles(channel_tiles(channels));
  const Team& team = *workers.team;
  for_each_own_tile(team, channels, [&](DataRange tile) {
    std::vector<Eigen::MatrixXd> shares(std::min(kShares, tile.count));
    for_each_task(workers.threads, static_cast<int>(shares.size()), [&](int share) {
      Eigen::MatrixXd& R = shares[share];
      R = factor(tile.first + share);
      for (Eigen::Index i = share + kShares; i < tile.count; i += kShares)
        append(R, factor(tile.first + i));
    });
    tiles[tile.first / kTileChannels] = merged(std::move(shares), workers.threads);
  });
  for (int owner = 0; team.divides(std::ssize(tiles)) && owner < team.size(); ++owner) {
    const TileShare of_owner = team.share(std::ssize(tiles), owner);
    for (Eigen::Index t = of_owner.first; t < of_owner.first + of_owner.count; ++t)
      broadcast(team, owner, tiles[t]);
  }
  return merged(std::move(tiles), workers.threads);
}

}  // namespace stageid
