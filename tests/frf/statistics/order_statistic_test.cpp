#include "frf/statistics/order_statistic.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_order_statistic {

TEST(OrderStatistic, IsWhereSortingPutsIt) {
  test::RandomNumbers random(5);
  for (const std::size_t size : {1U, 2U, 3U, 8U, 101U})
    for (const double share : {0.0, 0.25, 0.5, 0.9}) {
      std::vector<double> values(size);
      for (double& value : values) value = random.normal();
      std::vector<double> sorted = values;
      std::sort(sorted.begin(), sorted.end());
      EXPECT_EQ(order_statistic(values, share),
                sorted[static_cast<std::size_t>(share * static_cast<double>(size))]);
    }
  std::vector<double> four{4.0, 1.0, 3.0, 2.0};
  EXPECT_EQ(order_statistic(four, 0.5), 3.0);  // the upper median
  EXPECT_EQ(median(four), 2.5);
  std::vector<double> three{4.0, 1.0, 2.0};
  EXPECT_EQ(median(three), 2.0);
}

}  // namespace stageid::test_order_statistic
