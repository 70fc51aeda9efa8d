#pragma once

#include <cstddef>

namespace stageid::test {

/// The largest number of additional bytes on the heap between its construction and bytes(), of all threads. Link
/// heap_peak.cpp into the test executable; one object at a time.
class HeapPeak {
 public:
  HeapPeak() noexcept;
  std::size_t bytes() const noexcept;

  /// False where malloc is not ours (sanitizers bring their own): skip the test then.
  static bool works() noexcept;

 private:
  std::size_t before_;
};

}  // namespace stageid::test
