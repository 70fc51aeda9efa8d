#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

namespace stageid {

/// The newest of a stream of texts, for any number of readers. Slow readers skip editions; nothing is queued.
class LatestText {
 public:
  struct Edition {
    std::uint64_t number = 0;  ///< 0: none yet
    std::shared_ptr<const std::string> text;
  };

  void publish(std::string text) {
    auto next = std::make_shared<const std::string>(std::move(text));
    const std::lock_guard lock(mutex_);
    edition_ = {edition_.number + 1, std::move(next)};
    changed_.notify_all();
  }

  Edition get() const {
    const std::lock_guard lock(mutex_);
    return edition_;
  }

  /// Waits for an edition after `number`, at most for `longest`; returns the newest in either case.
  Edition wait(std::uint64_t number, std::chrono::milliseconds longest) const {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, longest, [&] { return edition_.number > number; });
    return edition_;
  }

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  Edition edition_;
};

}  // namespace stageid
