#include "tests/support/process/allocation_counter.hpp"

#include <cerrno>
#include <cstddef>
#include <cstdlib>

#include "tests/support/process/own_malloc.hpp"

namespace {

thread_local std::uint64_t allocations = 0;

}  // namespace

#if STAGEID_MALLOC_IS_OURS

extern "C" {
void* malloc(std::size_t size) noexcept {
  ++allocations;
  return __libc_malloc(size);
}

void* calloc(std::size_t count, std::size_t size) noexcept {
  ++allocations;
  return __libc_calloc(count, size);
}

void* realloc(void* old, std::size_t size) noexcept {
  ++allocations;
  return __libc_realloc(old, size);
}

void* memalign(std::size_t alignment, std::size_t size) noexcept {
  ++allocations;
  return __libc_memalign(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  ++allocations;
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** to, std::size_t alignment, std::size_t size) noexcept {
  ++allocations;
  *to = __libc_memalign(alignment, size);
  return *to == nullptr ? ENOMEM : 0;
}
}

#endif

namespace stageid::test {

AllocationCounter::AllocationCounter() noexcept : before_(allocations) {}

std::uint64_t AllocationCounter::count() const noexcept { return allocations - before_; }

bool AllocationCounter::works() noexcept {
  const AllocationCounter counter;
  // Volatile, because gcc removes an unused allocation.
  void* volatile memory = std::malloc(1);
  std::free(memory);
  return counter.count() == 1;
}

}  // namespace stageid::test
