#pragma once

#include <cstddef>

// For test executables with their own malloc: whether it is possible (sanitizers have theirs), and the functions to
// call.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
#define STAGEID_MALLOC_IS_OURS 0
#else
#define STAGEID_MALLOC_IS_OURS 1

// glibc's own names of the replaced functions.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* memory);
}
#endif
