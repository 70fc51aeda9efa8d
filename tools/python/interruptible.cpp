#include "tools/python/interruptible.hpp"

#include <chrono>
#include <functional>
#include <future>

#include "tools/python/bindings.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {

void run_interruptibly(const std::function<void()>& work) {
  constexpr std::chrono::milliseconds kLookForSignalsEvery{50};
  std::future<void> done = std::async(std::launch::async, std::cref(work));
  bool signalled = false;
  {
    const py::gil_scoped_release no_lock;
    while (done.wait_for(kLookForSignalsEvery) != std::future_status::ready) {
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
  done.get();  // rethrows
}

}  // namespace stageid
