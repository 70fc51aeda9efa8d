#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "excitation/threads/parcel.hpp"
#include "excitation/threads/team.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Channels that are multiplied together. Processes divide data and work by such tiles, so that sums are the same for
/// any number of processes.
constexpr Eigen::Index kTileChannels = 256;
inline Eigen::Index channel_tiles(Eigen::Index channels) {
  return (channels + kTileChannels - 1) / kTileChannels;
}
/// The channels of a tile.
inline DataRange channels_of_tile(Eigen::Index tile, Eigen::Index channels) {
  const Eigen::Index first = tile * kTileChannels;
  return {first, std::min(kTileChannels, channels - first)};
}
/// The channels of the tiles of a process; with one tile, all of them in every process.
inline DataRange channels_of(const Team& team, int rank, Eigen::Index channels) {
  const TileShare share = team.share(channel_tiles(channels), rank);
  const Eigen::Index first = std::min(share.first * kTileChannels, channels);
  return {first, std::min((share.first + share.count) * kTileChannels, channels) - first};
}
inline DataRange own_channels(const Team& team, Eigen::Index channels) {
  return channels_of(team, team.rank(), channels);
}

/// Calls use(channels) for every tile of this process.
template <typename Use>
void for_each_own_tile(const Team& team, Eigen::Index channels, const Use& use) {
  const TileShare own = team.share(channel_tiles(channels));
  for (Eigen::Index t = own.first; t < own.first + own.count; ++t)
    use(channels_of_tile(t, channels));
}

/// The sum of part(channels) over all tiles, `numbers` long each; each process computes its own tiles.
template <typename Part>
Eigen::VectorXd sum_over_tiles(const Team& team, Eigen::Index channels, Eigen::Index numbers,
                               const Part& part) {
  std::vector<Eigen::VectorXd> parts;
  for_each_own_tile(team, channels, [&](DataRange tile) { parts.push_back(part(tile)); });
  return team.sum(channel_tiles(channels), numbers, parts);
}

/// The same for parts that are one number.
template <typename Part>
double number_over_tiles(const Team& team, Eigen::Index channels, const Part& part) {
  return sum_over_tiles(team, channels, 1, [&](DataRange tile) {
    return Eigen::VectorXd::Constant(1, static_cast<double>(part(tile))).eval();
  })[0];
}

/// A copy of some rows of a matrix. Nobody writes the others, so their pages take no memory.
template <typename Matrix>
Matrix with_rows(const Matrix& from, DataRange rows) {
  if (rows.count == from.rows() || from.size() == 0) return from;
  Matrix out(from.rows(), from.cols());
  out.middleRows(rows.first, rows.count) = from.middleRows(rows.first, rows.count);
  return out;
}

/// Some channels, in rising order, on some lines. Each process sends those of its tiles to the others.
template <typename Scalar, typename Lines>
auto chosen_channels(const Team& team,
                     const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& matrix,
                     const std::vector<Eigen::Index>& channels, const Lines& lines) {
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  if (!team.divides(channel_tiles(matrix.rows()))) return Matrix(matrix(channels, lines));
  Matrix out(std::ssize(channels), matrix(channels, lines).cols());
  for (int owner = 0; owner < team.size(); ++owner) {
    const DataRange sent = channels_of(team, owner, matrix.rows());
    const auto first = std::ranges::lower_bound(channels, sent.first);
    const auto end = std::ranges::lower_bound(channels, sent.first + sent.count);
    Matrix rows;
    if (owner == team.rank()) rows = matrix(std::vector(first, end), lines);
    broadcast(team, owner, rows);
    out.middleRows(first - channels.begin(), rows.rows()) = rows;
  }
  return out;
}

}  // namespace stageid
