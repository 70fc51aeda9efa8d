#include "excitation/parallel_for.hpp"

#include <atomic>
#include <future>
#include <thread>
#include <vector>

namespace stageid {

void parallel_for(int count, const std::function<void(int)>& work) {
  std::atomic<int> next = 0;
  const auto take = [&] {
    for (int i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::future<void>> workers;
  for (unsigned i = 1; i < std::thread::hardware_concurrency() && static_cast<int>(i) < count; ++i)
    workers.push_back(std::async(std::launch::async, take));
  take();
  for (std::future<void>& worker : workers) worker.get();
}

}  // namespace stageid
