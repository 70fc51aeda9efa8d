#pragma once

#include <functional>

namespace stageid {

/// Calls work(0) ... work(count - 1) on all cores, each once, in any order: what they do must not
/// depend on each other. The first exception in the order of the threads goes on after all have ended.
void parallel_for(int count, const std::function<void(int)>& work);

}  // namespace stageid
