#pragma once

#include <functional>

namespace stageid {

/// Runs task(0) .. task(count - 1) on up to `threads` threads. Which thread runs a task does not
/// matter to the result. Throws what a task throws.
void parallel_tasks(int count, int threads, const std::function<void(int)>& task);

}  // namespace stageid
