#include "tests/support/process/heap_peak.hpp"

#include <malloc.h>

#include <atomic>
#include <cstdlib>

#include "tests/support/process/own_malloc.hpp"

namespace {

std::atomic<std::size_t> living{0};
std::atomic<std::size_t> largest{0};

#if STAGEID_MALLOC_IS_OURS
void* born(void* memory) noexcept {
  if (memory == nullptr) return memory;
  const std::size_t now = living += malloc_usable_size(memory);
  std::size_t before = largest;
  while (now > before && !largest.compare_exchange_weak(before, now)) {
  }
  return memory;
}

void dies(void* memory) noexcept {
  if (memory != nullptr) living -= malloc_usable_size(memory);
}
#endif

}  // namespace

namespace stageid::test {

HeapPeak::HeapPeak() noexcept : before_(living) { largest = before_; }

std::size_t HeapPeak::bytes() const noexcept { return largest - before_; }

bool HeapPeak::works() noexcept {
  constexpr std::size_t kSize = 1 << 20;
  const HeapPeak peak;
  // Volatile, because gcc removes an unused allocation.
  void* volatile memory = std::malloc(kSize);
  std::free(memory);
  return peak.bytes() >= kSize && living == peak.before_;
}

}  // namespace stageid::test
