#pragma once

#include <cerrno>
#include <cstddef>

// For the one source of a test executable that replaces the C library's malloc: whether it is possible (sanitizers
// have theirs), and the functions. They call born() with new memory, null included, and dies() with old memory.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
#define STAGEID_MALLOC_IS_OURS 0
#else
#define STAGEID_MALLOC_IS_OURS 1
namespace {
void* born(void* memory) noexcept;
void dies(void* memory) noexcept;
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
