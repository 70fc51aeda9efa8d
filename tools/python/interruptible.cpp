#include "tools/python/interruptible.hpp"

#include <pybind11/pybind11.h>

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

namespace py = pybind11;

constexpr std::chrono::milliseconds kLookForSignalsEvery{50};

/// Work in its thread, and the wait for its end.
class Worker {
 public:
  explicit Worker(const std::function<void()>& work)
      : thread_([this, &work] {
          try {
            work();
          } catch (...) {
            failure_ = std::current_exception();
          }
          const std::lock_guard lock(mutex_);
          done_ = true;
          changed_.notify_all();
        }) {}
  ~Worker() { thread_.join(); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  bool wait(std::chrono::milliseconds most) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, most, [this] { return done_; });
  }
  /// After wait() was true.
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool done_ = false;
  std::exception_ptr failure_;
  std::thread thread_;  // last: it uses all the others
};

}  // namespace

void run_interruptibly(const std::function<void()>& work) {
  Worker worker(work);
  bool signalled = false;
  {
    const py::gil_scoped_release no_lock;
    while (!worker.wait(kLookForSignalsEvery)) {
      if (signalled) continue;
      const py::gil_scoped_acquire lock;
      signalled = PyErr_CheckSignals() != 0;
      if (signalled) request_interrupt();
    }
  }
  if (signalled) {
    forget_interrupt();
    throw py::error_already_set();
  }
  worker.rethrow();
}

}  // namespace stageid
