#include "acquisition/loop/sample_ring.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace stageid::test_sample_ring {

TEST(SampleRing, GivesRowsBackInOrderAndSaysWhenFull) {
  SampleRing ring(3, 4);
  EXPECT_EQ(ring.capacity_rows(), 4U);
  EXPECT_TRUE(ring.front(10).empty());
  for (int n = 0; n < 4; ++n) {
    double* const row = ring.reserve();
    ASSERT_NE(row, nullptr);
    EXPECT_EQ(ring.reserve(), row) << "the same row until commit()";
    row[0] = n;
    row[2] = -n;
    ring.commit();
  }
  EXPECT_EQ(ring.reserve(), nullptr);
  const auto two = ring.front(2);
  ASSERT_EQ(two.size(), 6U);
  EXPECT_EQ(two[3], 1.0);
  ring.pop(2);
  EXPECT_NE(ring.reserve(), nullptr);
  ring.reserve()[0] = 4.0;
  ring.commit();
  // Rows 2 and 3, then the wrap, then row 4.
  EXPECT_EQ(ring.front(10).size(), 6U);
  EXPECT_EQ(ring.front(10)[0], 2.0);
  ring.pop(2);
  ASSERT_EQ(ring.front(10).size(), 3U);
  EXPECT_EQ(ring.front(10)[0], 4.0);
  EXPECT_EQ(ring.pushed(), 5U);
  EXPECT_EQ(ring.popped(), 4U);
}

TEST(SampleRing, RoundsTheCapacityUpAndRefusesNone) {
  EXPECT_EQ(SampleRing(1, 5).capacity_rows(), 8U);
  EXPECT_THROW(SampleRing(0, 4), std::invalid_argument);
  EXPECT_THROW(SampleRing(4, 0), std::invalid_argument);
}

// Meaningful mostly under ThreadSanitizer; without it still a test that no row is lost or torn.
TEST(SampleRing, TwoThreadsLoseNothing) {
  constexpr std::uint64_t kRows = 200'000;
  SampleRing ring(5, 64);
  std::thread producer([&] {
    for (std::uint64_t n = 0; n < kRows;) {
      double* const row = ring.reserve();
      if (row == nullptr) {
        std::this_thread::yield();
        continue;
      }
      for (int c = 0; c < 5; ++c) row[c] = static_cast<double>(5 * n) + c;
      ring.commit();
      ++n;
    }
  });
  double expected = 0.0;
  bool right = true;
  for (std::uint64_t n = 0; n < kRows;) {
    const auto rows = ring.front(17);
    if (rows.empty()) std::this_thread::yield();
    for (const double value : rows) {
      right &= value == expected;
      expected += 1.0;
    }
    ring.pop(rows.size() / 5);
    n += rows.size() / 5;
  }
  producer.join();
  EXPECT_TRUE(right);
  EXPECT_TRUE(ring.front(1).empty());
}

}  // namespace stageid::test_sample_ring
