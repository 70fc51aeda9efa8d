#include "excitation/threads/team.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <vector>

#include "tests/support/process/thread_team.hpp"

namespace stageid::test_team {

using test::run_team;

constexpr Eigen::Index kNumbers = 5;

/// Numbers of very different size, whose sum depends on the order.
Eigen::VectorXd part_of(Eigen::Index tile) {
  Eigen::VectorXd part(kNumbers);
  for (Eigen::Index i = 0; i < kNumbers; ++i)
    part[i] = std::sin(1.0 + static_cast<double>(tile * kNumbers + i)) *
              std::pow(10.0, static_cast<double>((7 * tile) % 17) - 8.0);
  return part;
}

Eigen::VectorXd sum_of(const Team& team, Eigen::Index tiles) {
  const TileShare own = team.share(tiles);
  std::vector<Eigen::VectorXd> parts;
  for (Eigen::Index t = own.first; t < own.first + own.count; ++t) parts.push_back(part_of(t));
  return team.sum(tiles, kNumbers, parts);
}

TEST(Team, SharesCoverAllTilesInOrder) {
  for (const int size : {1, 2, 3, 8})
    run_team(size, [&](const Team& team) {
      for (const Eigen::Index tiles : {2, 3, 7, 8, 391}) {
        Eigen::Index next = 0;
        for (int rank = 0; rank < size; ++rank) {
          EXPECT_EQ(team.share(tiles, rank).first, next);
          next += team.share(tiles, rank).count;
        }
        EXPECT_EQ(next, tiles);
      }
    });
}

TEST(Team, ASumHasTheSameBytesInEveryTeam) {
  for (const Eigen::Index tiles : {1, 2, 5, 64}) {
    const Eigen::VectorXd expected = sum_of(Team::one(), tiles);
    for (const int size : {2, 3, 4, 8})
      run_team(size, [&](const Team& team) {
        const Eigen::VectorXd sum = sum_of(team, tiles);
        EXPECT_EQ(std::memcmp(sum.data(), expected.data(), sizeof(double) * kNumbers), 0);
      });
  }
}

TEST(Team, ASumSendsItsNumbersTwicePerFurtherProcess) {
  for (const int size : {2, 3, 8}) {
    std::atomic<std::uint64_t> bytes = 0;
    std::atomic<std::uint64_t> messages = 0;
    run_team(size, [&](const Team& team) {
      sum_of(team, 64);
      bytes += team.traffic().bytes;
      messages += team.traffic().messages;
    });
    EXPECT_EQ(messages, 2u * static_cast<unsigned>(size - 1));
    EXPECT_EQ(bytes, messages * sizeof(double) * kNumbers);
  }
}

TEST(Team, EveryProcessReceivesTheRowsOfTheOthers) {
  constexpr Eigen::Index kRows = 37;
  for (const int size : {1, 3, 8})
    run_team(size, [&](const Team& team) {
      Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(kRows, 2);
      const TileShare own = team.share(8);
      for (Eigen::Index r = 5 * own.first; r < std::min(kRows, 5 * (own.first + own.count)); ++r)
        matrix.row(r).setConstant(static_cast<double>(r + 1));
      team.gather_rows(5, matrix);
      for (Eigen::Index r = 0; r < kRows; ++r)
        EXPECT_TRUE((matrix.row(r).array() == static_cast<double>(r + 1)).all()) << r;
    });
}

TEST(Team, EveryOwnerReachesAllOthers) {
  for (const int size : {1, 2, 3, 5, 8})
    run_team(size, [&](const Team& team) {
      for (int owner = 0; owner < size; ++owner) {
        std::vector<std::byte> bytes;
        if (team.rank() == owner) bytes.assign(static_cast<std::size_t>(owner) + 1, std::byte{7});
        team.broadcast(owner, bytes);
        EXPECT_EQ(bytes, std::vector(static_cast<std::size_t>(owner) + 1, std::byte{7}));
        EXPECT_TRUE(team.any(team.rank() == owner));
        EXPECT_FALSE(team.any(false));
      }
    });
}

}  // namespace stageid::test_team
