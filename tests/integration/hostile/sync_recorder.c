/* Records what a program makes durable in one directory, for tests: LD_PRELOAD with
 *   STAGEID_SYNC_OF=DIRECTORY   its files are recorded
 *   STAGEID_SYNC_TO=DIRECTORY   must exist; receives the file "trace" and copies of files
 * After each fsync(), fdatasync() and rename(), the trace receives one line of words separated by tabs: what happened,
 * then NAME=INODE of every file in the directory. What happened:
 *   data INODE COPY   the bytes of a file, as in COPY, are durable
 *   names             the names in the directory are durable
 *   rename            only the names have changed
 * A file must not be written by one thread while another one synchronizes it. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static int copies;

#define REAL(function) ((__typeof__(&function))dlsym(RTLD_NEXT, #function))

static void path_to(char* path, size_t size, const char* name) {
  snprintf(path, size, "%s/%s", getenv("STAGEID_SYNC_TO"), name);
}

static void tell(const char* what) {
  char path[4096];
  path_to(path, sizeof path, "trace");
  FILE* trace = fopen(path, "a");
  DIR* directory = opendir(getenv("STAGEID_SYNC_OF"));
  if (trace == NULL || directory == NULL) abort();
  fputs(what, trace);
  for (struct dirent* entry; (entry = readdir(directory)) != NULL;)
    if (entry->d_type == DT_REG) fprintf(trace, "\t%s=%lu", entry->d_name, (unsigned long)entry->d_ino);
  fputc('\n', trace);
  closedir(directory);
  if (fclose(trace) != 0) abort();
}

static void copy(const char* from, const char* name) {
  char path[4096];
  char bytes[65536];
  ssize_t size;
  path_to(path, sizeof path, name);
  const int in = open(from, O_RDONLY | O_CLOEXEC);
  const int out = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (in < 0 || out < 0) abort();
  while ((size = read(in, bytes, sizeof bytes)) > 0)
    if (write(out, bytes, (size_t)size) != size) abort();
  if (size < 0 || close(in) != 0 || close(out) != 0) abort();
}

static int recorded(int file, int result) {
  const int error = errno;
  const char* of = getenv("STAGEID_SYNC_OF");
  struct stat status;
  char link[64];
  char path[4096];
  char text[128];
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  const ssize_t length = result == 0 ? readlink(link, path, sizeof path - 1) : -1;
  path[length < 0 ? 0 : length] = '\0';
  if (of == NULL || strncmp(path, of, strlen(of)) != 0 || fstat(file, &status) != 0) return result;
  pthread_mutex_lock(&mutex);
  if (S_ISDIR(status.st_mode)) {
    tell("names");
  } else {
    snprintf(text, sizeof text, "%d.%d", getpid(), ++copies);
    copy(link, text);
    snprintf(text, sizeof text, "data\t%lu\t%d.%d", (unsigned long)status.st_ino, getpid(), copies);
    tell(text);
  }
  pthread_mutex_unlock(&mutex);
  errno = error;
  return result;
}

int fsync(int file) { return recorded(file, REAL(fsync)(file)); }
int fdatasync(int file) { return recorded(file, REAL(fdatasync)(file)); }
int rename(const char* from, const char* to) {
  const int result = REAL(rename)(from, to);
  if (result != 0 || getenv("STAGEID_SYNC_OF") == NULL) return result;
  pthread_mutex_lock(&mutex);
  tell("rename");
  pthread_mutex_unlock(&mutex);
  return result;
}
