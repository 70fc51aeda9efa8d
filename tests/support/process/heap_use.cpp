#include "tests/support/process/heap_use.hpp"

#include <malloc.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>

namespace {

thread_local std::uint64_t allocations = 0;
std::atomic<std::size_t> living{0};
std::atomic<std::size_t> largest{0};

}  // namespace

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && defined(__GLIBC__)
namespace {

void* born(void* memory) noexcept {
  ++allocations;
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
// glibc's own names of the replaced functions.
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* memory);

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
  return memalign(alignment, size);
}

int posix_memalign(void** to, std::size_t alignment, std::size_t size) noexcept {
  *to = memalign(alignment, size);
  return *to == nullptr ? ENOMEM : 0;
}

void free(void* memory) noexcept {
  dies(memory);
  __libc_free(memory);
}
}
#endif

namespace stageid::test {
namespace {

constexpr std::size_t kSize = 1 << 20;

void allocate_and_free() noexcept {
  // Volatile, because gcc removes an unused allocation.
  void* volatile memory = std::malloc(kSize);
  std::free(memory);
}

}  // namespace

AllocationCounter::AllocationCounter() noexcept : before_(allocations) {}

std::uint64_t AllocationCounter::count() const noexcept { return allocations - before_; }

bool AllocationCounter::works() noexcept {
  const AllocationCounter counter;
  allocate_and_free();
  return counter.count() == 1;
}

HeapPeak::HeapPeak() noexcept : before_(living) { largest = before_; }

std::size_t HeapPeak::bytes() const noexcept { return largest - before_; }

bool HeapPeak::works() noexcept {
  const HeapPeak peak;
  allocate_and_free();
  return peak.bytes() >= kSize && living == peak.before_;
}

}  // namespace stageid::test
