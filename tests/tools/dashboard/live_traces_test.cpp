#include "tools/dashboard/live_traces.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <vector>

namespace stageid::test_live_traces {

/// Samples of two channels, 0, 1, 2 ... and their negatives, and a status word.
std::vector<double> rows_of(int first, int count) {
  std::vector<double> rows;
  for (int n = first; n < first + count; ++n) rows.insert(rows.end(), {1.0 * n, -1.0 * n, 0.0});
  return rows;
}

TEST(LiveTraces, EachBinHasItsLeastAndLargestValue) {
  LiveTraces traces(2, 1000.0);  // 4 samples in each bin
  EXPECT_EQ(nlohmann::json::parse(traces.json(0))["low"].size(), 0U);
  traces.rows(rows_of(0, 3), 3);
  traces.rows(rows_of(3, 7), 3);
  const auto first = nlohmann::json::parse(traces.json(0));
  EXPECT_DOUBLE_EQ(first["bin_s"], 0.004);
  EXPECT_EQ(first["low"], (std::vector<double>{0.0, 4.0})) << "the third bin is not complete";
  EXPECT_EQ(first["high"], (std::vector<double>{3.0, 7.0}));
  EXPECT_EQ(nlohmann::json::parse(traces.json(1))["low"], (std::vector<double>{-3.0, -7.0}));
  for (const Eigen::Index unknown : {Eigen::Index{-1}, Eigen::Index{2}})
    EXPECT_EQ(nlohmann::json::parse(traces.json(unknown))["low"].size(), 0U);
}

TEST(LiveTraces, KeepsTheLastSeconds) {
  LiveTraces traces(2, 100.0);  // a sample each
  traces.rows(rows_of(0, 1234), 3);
  const auto told = nlohmann::json::parse(traces.json(0));
  ASSERT_EQ(told["low"].size(), static_cast<std::size_t>(LiveTraces::kBins));
  EXPECT_EQ(told["low"].front(), 734.0);
  EXPECT_EQ(told["high"].back(), 1233.0);
}

}  // namespace stageid::test_live_traces
