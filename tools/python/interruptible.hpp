#pragma once

#include <functional>
#include <optional>
#include <utility>

namespace stageid {

/// Does `work` in a thread of its own, without Python's interpreter lock, and looks for signals
/// meanwhile: Ctrl-C ends it at its next throw_if_interrupted() and becomes KeyboardInterrupt.
/// `work` touches nothing of Python. Called with the lock held; as Python has it, signals arrive at
/// the main thread only, and interrupt what all threads do here.
/// @throws what `work` throws; pybind11::error_already_set of the signal's handler.
void run_interruptibly(const std::function<void()>& work);

/// The same for work with a result.
template <typename Work>
auto interruptible(Work work) {
  std::optional<decltype(work())> result;
  run_interruptibly([&] { result.emplace(work()); });
  return std::move(*result);
}

}  // namespace stageid
