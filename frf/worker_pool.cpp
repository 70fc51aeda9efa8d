#include "frf/worker_pool.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace stageid {
namespace {

constexpr Eigen::Index kLinesATask = 64;

}  // namespace

int worker_count(int requested) {
  if (requested > 0) return requested;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void for_each_task(int workers, std::size_t count,
                   const std::function<void(int worker, std::size_t i)>& task) {
  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  std::mutex mutex;
  std::size_t failed_task = count;
  std::exception_ptr failure;

  const auto work = [&](int worker) {
    while (!failed) {
      const std::size_t i = next++;
      if (i >= count) return;
      try {
        task(worker, i);
      } catch (...) {
        failed = true;
        const std::lock_guard lock(mutex);
        if (i < failed_task) {
          failed_task = i;
          failure = std::current_exception();
        }
      }
    }
  };

  std::vector<std::jthread> threads;
  const auto used = std::min(static_cast<std::size_t>(std::max(workers, 1)), count);
  for (std::size_t worker = 1; worker < used; ++worker) {
    threads.emplace_back(work, static_cast<int>(worker));
  }
  work(0);
  threads.clear();  // joins
  if (failure) std::rethrow_exception(failure);
}

void for_each_line(int workers, Eigen::Index lines, const std::function<void(Eigen::Index)>& work) {
  const auto tasks = static_cast<std::size_t>((lines + kLinesATask - 1) / kLinesATask);
  for_each_task(workers, tasks, [&](int, std::size_t task) {
    const Eigen::Index first = static_cast<Eigen::Index>(task) * kLinesATask;
    for (Eigen::Index k = first; k < std::min(first + kLinesATask, lines); ++k) work(k);
  });
}

}  // namespace stageid
