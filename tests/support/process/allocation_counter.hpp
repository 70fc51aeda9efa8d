#pragma once

#include <cstdint>

namespace stageid::test {

/// Counts the heap allocations of the calling thread between its construction and count(): malloc,
/// calloc, realloc, the aligned ones, and with them operator new. Link allocation_counter.cpp into
/// the test executable.
class AllocationCounter {
 public:
  AllocationCounter() noexcept;
  std::uint64_t count() const noexcept;

  /// False where malloc is not ours (sanitizers bring their own): skip the test then.
  static bool works() noexcept;

 private:
  std::uint64_t before_;
};

}  // namespace stageid::test
