#pragma once

#include <unistd.h>

#include <cstddef>
#include <fstream>

namespace stageid::test {

/// Resident memory of this process; 0 with a sanitizer, whose own memory grows too.
inline std::size_t resident_bytes() {
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
  return 0;
#else
  std::ifstream file("/proc/self/statm");
  std::size_t pages = 0;
  file >> pages >> pages;
  return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
#endif
}

}  // namespace stageid::test
