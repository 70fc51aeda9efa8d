/* Makes the n-th call of one function fail in a program, for tests: LD_PRELOAD with
 *   STAGEID_FAULT=FUNCTION:N:ERRNO     FUNCTION: malloc read write fsync rename close mmap thread; N from 1
 *   STAGEID_FAULT_COUNT=FILE           receives the number of calls
 * Of read, write, fsync and close, only calls on regular files count. Functions of stdio count as what they do: glibc
 * calls the others from within, past any replacement. Child processes are not affected. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static char wanted[16];
static long first;
static int error_number;
static atomic_long calls;
static const char* count_file;
static pid_t process;

__attribute__((constructor)) static void start(void) {
  const char* text = getenv("STAGEID_FAULT");
  char name[16];
  process = getpid();
  count_file = getenv("STAGEID_FAULT_COUNT");
  if (text == NULL || sscanf(text, "%15[a-z]:%ld:%d", name, &first, &error_number) != 3) return;
  memcpy(wanted, name, sizeof wanted);
}

__attribute__((destructor)) static void stop(void) {
  wanted[0] = '\0';
  if (count_file == NULL || getpid() != process) return;
  FILE* file = fopen(count_file, "w");
  if (file == NULL) return;
  fprintf(file, "%ld\n", atomic_load(&calls));
  fclose(file);
}

static int fails(const char* function) {
  if (strcmp(wanted, function) != 0 || getpid() != process) return 0;
  if (atomic_fetch_add(&calls, 1) + 1 != first) return 0;
  errno = error_number;
  return 1;
}

static int fails_on(const char* function, int descriptor) {
  struct stat status;
  return strcmp(wanted, function) == 0 && fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) &&
         fails(function);
}

static void* found(const char* name) { return dlsym(RTLD_NEXT, name); }
#define REAL(function) ((__typeof__(&function))found(#function))

ssize_t read(int file, void* to, size_t size) { return fails_on("read", file) ? -1 : REAL(read)(file, to, size); }
ssize_t pread(int file, void* to, size_t size, off_t at) {
  return fails_on("read", file) ? -1 : REAL(pread)(file, to, size, at);
}
ssize_t pread64(int file, void* to, size_t size, off64_t at) {
  return fails_on("read", file) ? -1 : REAL(pread64)(file, to, size, at);
}
ssize_t write(int file, const void* from, size_t size) {
  return fails_on("write", file) ? -1 : REAL(write)(file, from, size);
}
ssize_t pwrite(int file, const void* from, size_t size, off_t at) {
  return fails_on("write", file) ? -1 : REAL(pwrite)(file, from, size, at);
}
ssize_t pwrite64(int file, const void* from, size_t size, off64_t at) {
  return fails_on("write", file) ? -1 : REAL(pwrite64)(file, from, size, at);
}
ssize_t writev(int file, const struct iovec* parts, int count) {
  return fails_on("write", file) ? -1 : REAL(writev)(file, parts, count);
}
size_t fwrite(const void* from, size_t size, size_t count, FILE* file) {
  return fails_on("write", fileno(file)) ? 0 : REAL(fwrite)(from, size, count, file);
}
int fsync(int file) { return fails_on("fsync", file) ? -1 : REAL(fsync)(file); }
int fdatasync(int file) { return fails_on("fsync", file) ? -1 : REAL(fdatasync)(file); }
int rename(const char* from, const char* to) { return fails("rename") ? -1 : REAL(rename)(from, to); }
int close(int file) {
  const int failing = fails_on("close", file);
  const int result = REAL(close)(file);
  if (failing) errno = error_number;
  return failing ? -1 : result;
}
int fclose(FILE* file) {
  const int failing = fails_on("close", fileno(file));
  const int result = REAL(fclose)(file);
  if (failing) errno = error_number;
  return failing ? EOF : result;
}
void* mmap(void* at, size_t size, int protection, int flags, int file, off_t offset) {
  return fails("mmap") ? MAP_FAILED : REAL(mmap)(at, size, protection, flags, file, offset);
}
int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*work)(void*), void* argument) {
  return fails("thread") ? EAGAIN : REAL(pthread_create)(thread, attributes, work, argument);
}

/* By glibc's own names, because dlsym() allocates. */
extern void* __libc_malloc(size_t);
extern void* __libc_calloc(size_t, size_t);
extern void* __libc_realloc(void*, size_t);
extern void* __libc_memalign(size_t, size_t);
void* malloc(size_t size) { return fails("malloc") ? NULL : __libc_malloc(size); }
void* calloc(size_t count, size_t size) { return fails("malloc") ? NULL : __libc_calloc(count, size); }
void* realloc(void* old, size_t size) { return fails("malloc") ? NULL : __libc_realloc(old, size); }
void* aligned_alloc(size_t alignment, size_t size) {
  return fails("malloc") ? NULL : __libc_memalign(alignment, size);
}
int posix_memalign(void** to, size_t alignment, size_t size) {
  *to = fails("malloc") ? NULL : __libc_memalign(alignment, size);
  return *to == NULL ? ENOMEM : 0;
}
