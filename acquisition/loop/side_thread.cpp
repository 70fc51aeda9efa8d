#include "acquisition/loop/side_thread.hpp"

#include <chrono>
#include <utility>

#include "hal/stage/real_time.hpp"

namespace stageid {

namespace {

constexpr std::chrono::microseconds kPause{500};

}  // namespace

SideThread::SideThread() : thread_([this](const std::stop_token& stop) { run(stop); }) {}

void SideThread::rethrow() {
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

void SideThread::run(const std::stop_token& stop) noexcept {
  take_normal_priority();
  while (!stop.stop_requested()) {
    const Call call = call_.load(std::memory_order_acquire);
    if (call == nullptr) {
      std::this_thread::sleep_for(kPause);
      continue;
    }
    try {
      call(context_);
    } catch (...) {
      failure_ = std::current_exception();
    }
    call_.store(nullptr, std::memory_order_release);
  }
}

}  // namespace stageid
