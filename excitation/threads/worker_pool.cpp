#include "excitation/threads/worker_pool.hpp"

#include <sched.h>

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
  cpu_set_t allowed;
  if (::sched_getaffinity(0, sizeof allowed, &allowed) == 0)
    return std::max(1, CPU_COUNT(&allowed));
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void for_each_task(int threads, std::size_t count,
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

  std::vector<std::jthread> others;
  const auto used = std::min(static_cast<std::size_t>(worker_count(threads)), count);
  for (std::size_t worker = 1; worker < used; ++worker) {
    others.emplace_back(work, static_cast<int>(worker));
  }
  work(0);
  others.clear();  // joins
  if (failure) std::rethrow_exception(failure);
}

void for_each_task(int threads, int count, const std::function<void(int)>& task) {
  for_each_task(threads, static_cast<std::size_t>(std::max(count, 0)),
                [&](int, std::size_t i) { task(static_cast<int>(i)); });
}

void for_each_line(int workers, Eigen::Index lines, const std::function<void(Eigen::Index)>& work) {
  const auto tasks = static_cast<std::size_t>((lines + kLinesATask - 1) / kLinesATask);
  for_each_task(workers, tasks, [&](int, std::size_t task) {
    const Eigen::Index first = static_cast<Eigen::Index>(task) * kLinesATask;
    for (Eigen::Index k = first; k < std::min(first + kLinesATask, lines); ++k) work(k);
  });
}

}  // namespace stageid
