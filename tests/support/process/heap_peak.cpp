#include "tests/support/process/heap_peak.hpp"

#include <malloc.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>

#include "tests/support/process/own_malloc.hpp"

namespace {

std::atomic<std::size_t> living{0};
std::atomic<std::size_t> largest{0};

}  // namespace

#if STAGEID_MALLOC_IS_OURS

namespace {

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

}  // namespace

extern "C" {
void* malloc(std::size_t size) noexcept { return born(__libc_malloc(size)); }
void* calloc(std::size_t count, std::size_t size) noexcept {
  return born(__libc_calloc(count, size));
}

void* realloc(void* old, std::size_t size) noexcept {
  dies(old);
  void* memory = __libc_realloc(old, size);
  if (memory == nullptr && size > 0) born(old);  // it lives on
  return born(memory);
}

void* memalign(std::size_t alignment, std::size_t size) noexcept {
  return born(__libc_memalign(alignment, size));
}

void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  return born(__libc_memalign(alignment, size));
}

int posix_memalign(void** to, std::size_t alignment, std::size_t size) noexcept {
  *to = born(__libc_memalign(alignment, size));
  return *to == nullptr ? ENOMEM : 0;
}

void free(void* memory) noexcept {
  dies(memory);
  __libc_free(memory);
}
}

#endif

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
