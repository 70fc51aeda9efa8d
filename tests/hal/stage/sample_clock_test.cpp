#include "hal/stage/sample_clock.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

namespace stageid::test_sample_clock {

constexpr std::int64_t kPeriod_ns = 1'000'000;
constexpr std::int64_t kLimit_ns = 20'000;
constexpr double kDrift = 80e-6;
constexpr std::int64_t kOffset_ns = 123'456'789'012'345;

std::int64_t stamp(std::int64_t expected_ns) {
  return kOffset_ns + expected_ns + std::llround(kDrift * static_cast<double>(expected_ns));
}

TEST(SampleClock, ManyLateSamplesDoNotPassForTheInstantOfAll) {
  SampleClock clock(10'000'000, 800'000);
  for (std::int64_t n = 0; n < 5000; ++n)
    static_cast<void>(clock.take(n * 20'000'000, n * 20'000'000 + (n % 7 == 3 ? 4'000'000 : 0)));
  // One of seven pulls by 0.8 ms, the others hold by what they deviate: 0.8 ms / 6.
  constexpr std::int64_t kNext_ns = 5000 * 20'000'000LL;
  EXPECT_NEAR(static_cast<double>(clock.stamp_ns(kNext_ns) - kNext_ns), 0.13e6, 0.1e6);
}

TEST(SampleClock, FindsOffsetAndDriftAndThenTheJitterOfEachSample) {
  SampleClock clock(kLimit_ns);
  std::mt19937 random(7);
  std::int64_t largest = 0;
  for (std::int64_t n = 0; n < 4000; ++n) {
    // Uniform within +-2 us: the shape does not matter.
    const std::int64_t jitter = static_cast<std::int64_t>(random() % 4001) - 2000;
    const std::int64_t seen = clock.take(n * kPeriod_ns, stamp(n * kPeriod_ns) + jitter);
    if (n >= 1000) largest = std::max(largest, std::abs(seen - jitter));
  }
  // The filter passes sqrt(a / 2) = 0.1 of the rms of 1.2 us to its estimate; four sigma are 0.5 us.
  EXPECT_LT(largest, 600);
  const std::int64_t second_ns = clock.stamp_ns(5'000'000'000) - clock.stamp_ns(4'000'000'000);
  EXPECT_NEAR(static_cast<double>(second_ns) * 1e-9 - 1.0, kDrift, 10e-6);
  EXPECT_NEAR(static_cast<double>(clock.stamp_ns(5'000'000'000) - stamp(5'000'000'000)), 0.0, 15e3);
}

TEST(SampleClock, OneLateSampleDoesNotMakeTheNextOneEarly) {
  SampleClock clock(kLimit_ns);
  for (std::int64_t n = 0; n < 2000; ++n) clock.take(n * kPeriod_ns, stamp(n * kPeriod_ns));
  const std::int64_t late = 2000 * kPeriod_ns;
  EXPECT_NEAR(static_cast<double>(clock.take(late, stamp(late) + 900'000)), 900'000.0, 50.0);
  const std::int64_t next = 2001 * kPeriod_ns;
  EXPECT_NEAR(static_cast<double>(clock.take(next, stamp(next))), 0.0, 50.0);
}

TEST(SampleClock, AJumpIsIrregularThreeTimesAndThenFollowed) {
  SampleClock clock(kLimit_ns);
  for (std::int64_t n = 0; n < 2000; ++n) clock.take(n * kPeriod_ns, stamp(n * kPeriod_ns));
  int irregular = 0;
  for (std::int64_t n = 2000; n < 2100; ++n)
    irregular +=
        std::abs(clock.take(n * kPeriod_ns, stamp((n + 1) * kPeriod_ns))) > kLimit_ns ? 1 : 0;
  EXPECT_EQ(irregular, 3);
}

TEST(SampleClock, TheLimitFollowsFromTheBand) {
  const double jitter_s = tolerable_jitter_s(200.0);
  EXPECT_NEAR(2.0 * 3.14159265358979 * 200.0 * jitter_s, 0.1, 1e-12);
}

}  // namespace stageid::test_sample_clock
