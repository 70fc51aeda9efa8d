#include "acquisition/record/run_timing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "acquisition/slog/slog_json.hpp"
#include "tests/acquisition/files/expect_error.hpp"

namespace stageid::test_run_timing {

TEST(TimingHistogram, EveryNumberLiesInItsBinAndBinsAreNarrow) {
  std::mt19937_64 engine(3);
  for (int shift = 32; shift < 64; ++shift) {
    for (int repeat = 0; repeat < 200; ++repeat) {
      const auto ns = static_cast<std::uint32_t>(engine() >> shift);
      const std::size_t bin = TimingHistogram::bin_of(ns);
      ASSERT_LT(bin, TimingHistogram::kBins);
      ASSERT_LE(TimingHistogram::lower_ns(bin), ns);
      ASSERT_LT(ns, TimingHistogram::upper_ns(bin));
      const auto width = TimingHistogram::upper_ns(bin) - TimingHistogram::lower_ns(bin);
      ASSERT_TRUE(width == 1 || 8 * width <= TimingHistogram::lower_ns(bin)) << ns;
    }
  }
  EXPECT_EQ(TimingHistogram::bin_of(0xFFFF'FFFF), TimingHistogram::kBins - 1);
}

TEST(TimingHistogram, NothingIsLostBelowZeroOrFarAbove) {
  TimingHistogram histogram;
  histogram.add(-5);
  histogram.add(std::int64_t{1} << 40);
  EXPECT_EQ(histogram.count(0), 1U);
  EXPECT_EQ(histogram.count(TimingHistogram::kBins - 1), 1U);
  EXPECT_EQ(histogram.total(), 2U);
}

TEST(TimingHistogram, QuantilesAreThoseOfTheSortedNumbersToABin) {
  std::mt19937_64 engine(8);
  std::vector<std::int64_t> values;
  TimingHistogram histogram;
  for (int i = 0; i < 10'000; ++i) {
    values.push_back(static_cast<std::int64_t>(engine() >> (36 + engine() % 20)));
    histogram.add(values.back());
  }
  std::sort(values.begin(), values.end());
  for (const double share : {0.0, 0.01, 0.5, 0.9, 0.999, 1.0}) {
    const auto rank = std::max(1.0, std::ceil(share * 10'000.0));
    const auto exact = static_cast<double>(values[static_cast<std::size_t>(rank) - 1]);
    // The upper edge of its bin.
    EXPECT_GT(1e9 * histogram.quantile_s(share), exact) << share;
    EXPECT_LE(1e9 * histogram.quantile_s(share), 1.125 * exact + 1.0) << share;
  }
  EXPECT_EQ(TimingHistogram().quantile_s(0.5), 0.0);
}

TEST(RunTiming, AddsUp) {
  RunTiming a;
  a.execution.add(100);
  a.lateness.add(7);
  a.skipped = 2;
  RunTiming sum = a;
  sum += a;
  EXPECT_EQ(sum.execution.total(), 2U);
  EXPECT_EQ(sum.lateness.count(7), 2U);
  EXPECT_EQ(sum.skipped, 4U);
}

TEST(RunTiming, ComesBackFromTheLogsText) {
  LogRun end;
  for (int i = 0; i < 5000; i += 7) end.timing.execution.add(i * i);
  end.timing.lateness.add(3);
  end.timing.skipped = 11;
  EXPECT_EQ(parse_run_end(run_end_json(end)).timing, end.timing);
}

TEST(RunTiming, IsNotWrittenInVirtualTimeNorMissedInOldLogs) {
  const std::string text = run_end_json({});
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("timing")));
  EXPECT_TRUE(parse_run_end(text).timing.empty());
}

TEST(RunTiming, ABinThatIsNoneIsRefused) {
  LogRun end;
  end.timing.lateness.add(32);  // bins of 32: [32, 36)
  std::string text = run_end_json(end);
  text.replace(text.find("[32,"), 4, "[33,");
  test::expect_error<std::invalid_argument>([&] { parse_run_end(text); }, "", "33 ns");
}

}  // namespace stageid::test_run_timing
