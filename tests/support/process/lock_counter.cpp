#include "tests/support/process/lock_counter.hpp"

#include <dlfcn.h>
#include <pthread.h>
#include <semaphore.h>

#include <mutex>

namespace {

thread_local std::uint64_t locks = 0;

/// The function of this name in the C library.
template <typename Function>
Function next(const char* name) noexcept {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

#if !defined(__SANITIZE_THREAD__) && !defined(__SANITIZE_ADDRESS__)

#define STAGEID_COUNTED(name, parameters, arguments)         \
  int name parameters noexcept {                             \
    static const auto real = next<int(*) parameters>(#name); \
    ++locks;                                                 \
    return real arguments;                                   \
  }

extern "C" {
STAGEID_COUNTED(pthread_mutex_lock, (pthread_mutex_t * mutex), (mutex))
STAGEID_COUNTED(pthread_mutex_trylock, (pthread_mutex_t * mutex), (mutex))
STAGEID_COUNTED(pthread_mutex_timedlock, (pthread_mutex_t * mutex, const timespec* until),
                (mutex, until))
STAGEID_COUNTED(pthread_rwlock_rdlock, (pthread_rwlock_t * lock), (lock))
STAGEID_COUNTED(pthread_rwlock_wrlock, (pthread_rwlock_t * lock), (lock))
STAGEID_COUNTED(pthread_cond_signal, (pthread_cond_t * condition), (condition))
STAGEID_COUNTED(pthread_cond_broadcast, (pthread_cond_t * condition), (condition))
STAGEID_COUNTED(sem_post, (sem_t * semaphore), (semaphore))
}

#endif

namespace stageid::test {

LockCounter::LockCounter() noexcept : before_(locks) {}

std::uint64_t LockCounter::count() const noexcept { return locks - before_; }

bool LockCounter::works() noexcept {
  const LockCounter counter;
  std::mutex mutex;
  mutex.lock();
  mutex.unlock();
  return counter.count() == 1;
}

}  // namespace stageid::test
