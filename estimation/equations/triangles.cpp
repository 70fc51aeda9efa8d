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

}  // namespace

Eigen::MatrixXd triangle_after(Eigen::Index eliminated, Eigen::MatrixXd& A) {
  qr_in_place(A);
  const Eigen::Index rest = A.cols() - eliminated;
  return Eigen::MatrixXd(
      A.block(eliminated, eliminated, rest, rest).triangularView<Eigen::Upper>());
}

Eigen::MatrixXd stacked_triangle(Eigen::Index count, const Workers& workers,
                                 const std::function<Eigen::MatrixXd(Eigen::Index)>& factor) {
  std::vector<Eigen::MatrixXd> shares(std::min(kShares, count));
  const Team& divided = channel_tiles(count) > 1 ? *workers.team : Team::one();
  const TileShare own = divided.share(std::ssize(shares));
  for_each_task(workers.threads, static_cast<int>(own.count), [&](int task) {
    const Eigen::Index share = own.first + task;
    Eigen::MatrixXd& R = shares[share];
    R = factor(share);
    for (Eigen::Index i = share + kShares; i < count; i += kShares) append(R, factor(i));
  });
  for (int owner = 0; owner < divided.size(); ++owner) {
    const TileShare of_owner = divided.share(std::ssize(shares), owner);
    for (Eigen::Index i = of_owner.first; i < of_owner.first + of_owner.count; ++i)
      broadcast(divided, owner, shares[i]);
  }
  while (shares.size() > 1) {
    const std::size_t pairs = shares.size() / 2;
    for_each_task(workers.threads, static_cast<int>(pairs),
                  [&](int pair) { append(shares[pair], shares[shares.size() - 1 - pair]); });
    shares.resize(shares.size() - pairs);
  }
  return std::move(shares.front());
}

}  // namespace stageid
