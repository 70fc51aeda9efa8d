#pragma once

#include <cstdint>

namespace stageid::test {

/// Counts the lock operations of the calling thread between its construction and count(): mutexes, read-write locks,
/// condition variables, semaphores, including attempts and signals. Link lock_counter.cpp into the test executable.
class LockCounter {
 public:
  LockCounter() noexcept;
  std::uint64_t count() const noexcept;

  /// False where these functions are not ours (thread sanitizer brings its own): skip the test then.
  static bool works() noexcept;

 private:
  std::uint64_t before_;
};

}  // namespace stageid::test
