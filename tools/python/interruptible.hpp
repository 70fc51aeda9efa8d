#pragma once

#include <functional>
#include <optional>
#include <utility>

namespace stageid {

/// Runs `work` in its own thread, without Python's interpreter lock, and checks for signals meanwhile: Ctrl-C ends it
/// at its next throw_if_interrupted() and becomes KeyboardInterrupt. `work` must not use Python. Must be called with
/// the lock held. In Python, signals arrive at the main thread only, and interrupt the work of all threads here.
/// @throws the exceptions of `work`; pybind11::error_already_set of the signal handler.
void run_interruptibly(const std::function<void()>& work);

/// The same for work with a result.
template <typename Work>
auto interruptible(Work work) {
  std::optional<decltype(work())> result;
  run_interruptibly([&] { result.emplace(work()); });
  return std::move(*result);
}

}  // namespace stageid
