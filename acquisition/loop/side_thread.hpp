#pragma once

#include <atomic>
#include <exception>
#include <stop_token>
#include <thread>

namespace stageid {

/// Does one job at a time beside the loop, which keeps cycling: handing over takes no lock and allocates nothing. The
/// thread has normal priority.
class SideThread {
 public:
  SideThread();

  /// Begins a job, which must live until done().
  template <typename Job>
  void begin(Job& job) noexcept {
    context_ = &job;
    call_.store([](void* context) { (*static_cast<Job*>(context))(); }, std::memory_order_release);
  }
  bool done() const noexcept { return call_.load(std::memory_order_acquire) == nullptr; }
  /// After done(): throws what the job threw.
  void rethrow();

 private:
  using Call = void (*)(void*);
  void run(const std::stop_token& stop) noexcept;

  std::atomic<Call> call_ = nullptr;
  void* context_ = nullptr;
  std::exception_ptr failure_;
  std::jthread thread_;  // last: it uses all other members
};

}  // namespace stageid
