#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>

namespace stageid {

/// `requested` threads, or one per core that the process may use if it is not positive; at least one.
int worker_count(int requested);

/// Calls task(worker, i) once for every i = 0 .. count - 1 from worker_count(threads) threads, the caller
/// included; worker = 0 .. threads - 1. Tasks start in order of i and must not depend on each other.
///
/// After an exception no further task starts. The exception of the smallest i is rethrown, so that the
/// message does not depend on the number of threads.
void for_each_task(int threads, std::size_t count,
                   const std::function<void(int worker, std::size_t i)>& task);

/// The same for tasks without storage per worker. A negative count counts as zero.
void for_each_task(int threads, int count, const std::function<void(int i)>& task);

/// Calls work(k) once for every line k = 0 .. lines - 1, in tasks of a fixed number of lines.
void for_each_line(int workers, Eigen::Index lines, const std::function<void(Eigen::Index)>& work);

}  // namespace stageid
