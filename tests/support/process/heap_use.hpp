#pragma once

#include <cstddef>
#include <cstdint>

// Link heap_use.cpp into the test executable: it replaces the C library's malloc, calloc, realloc and the aligned ones,
// and with them operator new.
namespace stageid::test {

/// Counts the heap allocations of the calling thread between its construction and count().
class AllocationCounter {
 public:
  AllocationCounter() noexcept;
  std::uint64_t count() const noexcept;

  /// False where malloc is not ours (sanitizers bring their own): skip the test then.
  static bool works() noexcept;

 private:
  std::uint64_t before_;
};

/// The largest number of additional bytes on the heap between its construction and bytes(), of all threads. One object
/// at a time.
class HeapPeak {
 public:
  HeapPeak() noexcept;
  std::size_t bytes() const noexcept;

  static bool works() noexcept;  ///< as above

 private:
  std::size_t before_;
};

}  // namespace stageid::test
