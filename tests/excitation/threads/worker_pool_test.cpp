#include "excitation/threads/worker_pool.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace stageid::test_worker_pool {

TEST(WorkerPool, EveryTaskRunsOnce) {
  std::vector<int> count(1000, 0);
  for_each_task(4, count.size(), [&](int, std::size_t i) { ++count[i]; });
  EXPECT_EQ(count, std::vector<int>(1000, 1));
  for_each_task(4, 0, [](int, std::size_t) { FAIL(); });
}

TEST(WorkerPool, TheFirstFailureIsThrown) {
  for (int repetition = 0; repetition < 20; ++repetition) {
    try {
      for_each_task(4, 100, [](int, std::size_t i) {
        if (i >= 10) throw std::runtime_error(std::to_string(i));
      });
      FAIL();
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "10");
    }
  }
}

TEST(WorkerPool, TasksWithoutAWorkerRunOnceAndPassExceptionsOn) {
  std::vector<int> calls(100, 0);
  for_each_task(0, 100, [&](int i) { ++calls[i]; });
  EXPECT_EQ(calls, std::vector<int>(100, 1));
  EXPECT_THROW(for_each_task(0, 8,
                             [](int i) {
                               if (i == 5) throw std::runtime_error("5");
                             }),
               std::runtime_error);
}

}  // namespace stageid::test_worker_pool
