#include "hal/stage/pacer.hpp"

#include <gtest/gtest.h>

namespace stageid::test_pacer {

// A clock cannot be stopped, so only order and phase are checked, which are independent of the machine's speed.
constexpr double kRate_hz = 1000.0;
constexpr std::int64_t kPeriod_ns = 1'000'000;

void pass(std::int64_t ns) {
  const std::int64_t end = monotonic_ns() + ns;
  while (monotonic_ns() < end) {
  }
}

TEST(Pacer, VirtualTimeCountsSamples) {
  Pacer pacer(kRate_hz, 0.0);
  EXPECT_EQ(pacer.restart().sample_ns, 0);
  for (int n = 1; n < 5; ++n) {
    const Pacer::Instant at = pacer.wait();
    EXPECT_EQ(at.sample_ns, n * kPeriod_ns);
    EXPECT_EQ(at.now_ns, at.sample_ns);
    EXPECT_EQ(at.ready_ns, 0);
    EXPECT_FALSE(at.late);
  }
}

TEST(Pacer, NeverWakesBeforeTheInstantAndTellsWhenItBeganToWait) {
  Pacer pacer(kRate_hz, 1.0);
  const std::int64_t origin = pacer.restart().sample_ns;
  std::int64_t last = origin;
  for (int n = 0; n < 20; ++n) {
    const std::int64_t before = monotonic_ns();
    const Pacer::Instant at = pacer.wait();
    EXPECT_GE(at.now_ns, at.sample_ns);
    EXPECT_GE(at.ready_ns, before);
    EXPECT_LE(at.ready_ns, at.now_ns);
    EXPECT_EQ((at.sample_ns - origin) % kPeriod_ns, 0);
    EXPECT_GT(at.sample_ns, last);
    last = at.sample_ns;
  }
}

TEST(Pacer, LeavesOutWholePeriodsAndKeepsThePhase) {
  Pacer pacer(kRate_hz, 1.0);
  const std::int64_t origin = pacer.restart().sample_ns;
  pass(5 * kPeriod_ns + kPeriod_ns / 2);
  const Pacer::Instant late = pacer.wait();
  EXPECT_TRUE(late.late);
  EXPECT_EQ(late.sample_ns, origin + kPeriod_ns);  // the missed instant
  const std::int64_t skipped = (late.now_ns - late.sample_ns) / kPeriod_ns;
  EXPECT_GE(skipped, 4);
  const Pacer::Instant next = pacer.wait();
  EXPECT_EQ(next.sample_ns, late.sample_ns + (skipped + 1) * kPeriod_ns);
}

TEST(Pacer, PaceIsStageTimeOverWallTime) {
  Pacer pacer(kRate_hz, 4.0);
  const std::int64_t origin = pacer.restart().sample_ns;
  EXPECT_EQ(pacer.wait().sample_ns - origin, kPeriod_ns / 4);
}

}  // namespace stageid::test_pacer
