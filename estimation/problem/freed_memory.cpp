#include "estimation/problem/freed_memory.hpp"

#include <malloc.h>

namespace stageid {

void keep_freed_memory() {
  constexpr int kKept_bytes = 64 << 20;
  constexpr int kHandedBack_bytes = 32 << 20;
  mallopt(M_TRIM_THRESHOLD, kKept_bytes);
  mallopt(M_MMAP_THRESHOLD, kHandedBack_bytes);
}

}  // namespace stageid
