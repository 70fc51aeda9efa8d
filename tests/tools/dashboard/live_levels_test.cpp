#include "tools/dashboard/live_levels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

namespace stageid::test_live_levels {

/// Rows of two channels and a status word.
std::vector<double> rows_of(const std::vector<std::pair<double, double>>& values) {
  std::vector<double> rows;
  for (const auto& [a, b] : values) rows.insert(rows.end(), {a, b, 0.0});
  return rows;
}

TEST(LiveLevels, PeakAndRmsAreThoseSinceTheLastLook) {
  LiveLevels levels(2);
  levels.rows(rows_of({{1.0, 0.0}, {-3.0, 0.5}}), 3);
  levels.rows(rows_of({{2.0, -0.5}}), 3);
  Levels seen = levels.take();
  EXPECT_EQ(seen.rows, 3U);
  EXPECT_EQ(seen.peak[0], 3.0);
  EXPECT_EQ(seen.peak[1], 0.5);
  EXPECT_DOUBLE_EQ(seen.rms[0], std::sqrt(14.0 / 3.0));
  EXPECT_DOUBLE_EQ(seen.rms[1], std::sqrt(0.5 / 3.0));

  levels.rows(rows_of({{0.25, 0.0}}), 3);
  seen = levels.take();
  EXPECT_EQ(seen.peak[0], 0.25);
  EXPECT_EQ(seen.largest_peak[0], 3.0);
  EXPECT_EQ(levels.take().rows, 0U);
}

TEST(LiveLevels, RunsThatHaveEndedAddUp) {
  LiveLevels levels(1);
  LogRun run;
  run.health.late = 2;
  run.timing.skipped = 3;
  run.realization = 4;
  levels.end_run(run);
  levels.end_run(run);
  EXPECT_EQ(levels.ended().runs, 2);
  EXPECT_EQ(levels.ended().health.late, 4U);
  EXPECT_EQ(levels.ended().timing.skipped, 6U);
  EXPECT_EQ(levels.ended().last.realization, 4);
}

TEST(LiveLevels, NothingIsLostToWhoeverLooksAllTheTime) {
  LiveLevels levels(2);
  constexpr std::uint64_t kRows = 200'000;
  std::uint64_t seen = 0;
  std::atomic<bool> done = false;
  std::thread looker([&] {
    while (!done) seen += levels.take().rows;
  });
  const auto rows = rows_of({{1.0, 2.0}});
  for (std::uint64_t i = 0; i < kRows; ++i) levels.rows(rows, 3);
  done = true;
  looker.join();
  levels.rows({}, 3);  // hands over the levels gathered while the reader held the lock
  seen += levels.take().rows;
  EXPECT_EQ(seen, kRows);
}

}  // namespace stageid::test_live_levels
