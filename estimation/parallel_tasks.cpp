#include "estimation/parallel_tasks.hpp"

#include <cstddef>

#include "frf/worker_pool.hpp"

namespace stageid {

void parallel_tasks(int count, int threads, const std::function<void(int)>& task) {
  if (count <= 0) return;
  for_each_task(threads, static_cast<std::size_t>(count),
                [&](int, std::size_t i) { task(static_cast<int>(i)); });
}

}  // namespace stageid
