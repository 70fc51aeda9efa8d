#include "tests/support/process/allocation_counter.hpp"

#include <cstdlib>

#include "tests/support/process/own_malloc.hpp"

namespace {

thread_local std::uint64_t allocations = 0;

#if STAGEID_MALLOC_IS_OURS
void* born(void* memory) noexcept {
  ++allocations;
  return memory;
}

void dies(void*) noexcept {}
#endif

}  // namespace

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
