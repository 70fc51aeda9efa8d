#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace stageid {

enum class RealTimePolicy : std::uint8_t {
  off,      ///< leave the scheduler alone
  attempt,  ///< take what there is and say what is missing
  require   ///< refuse to run without rights or without a PREEMPT_RT kernel
};

/// How the thread of the loop asks to be scheduled. Without meaning in virtual time.
struct RealTimeOptions {
  RealTimePolicy policy = RealTimePolicy::off;
  int priority = 80;        ///< of SCHED_FIFO, 1 to 99
  int cpu = -1;             ///< the loop is pinned to it; -1: not pinned
  bool lock_memory = true;  ///< no page of the process goes to the swap
};

/// True if the kernel is a fully preemptible one, by what it says of itself: `version` as uname -v
/// gives it, `flag` the content of /sys/kernel/realtime (empty where there is no such file).
bool is_preempt_rt(std::string_view version, std::string_view flag) noexcept;

/// While it lives, the thread that made it is a real-time one: SCHED_FIFO, pinned, wake-ups without
/// timer slack, the memory of the process locked. Memory is locked page by page as it is first
/// touched, so that the stacks of forty threads are not.
///
/// The destructor unlocks the memory; priority and processor stay with the thread until it ends.
class RealTime {
 public:
  /// @throws StageError with policy `require` if something is missing: tells what, and the remedy.
  /// @throws std::invalid_argument on a priority outside 1 to 99 or a processor that is not there.
  explicit RealTime(const RealTimeOptions& options);
  ~RealTime();
  RealTime(const RealTime&) = delete;
  RealTime& operator=(const RealTime&) = delete;

  /// What was asked for and could not be had, with the remedy, one line each.
  const std::vector<std::string>& missing() const noexcept { return missing_; }

 private:
  std::vector<std::string> missing_;
  bool locked_ = false;
};

/// What RealTime would miss, found out by a thread that ends at once: before anything is started.
/// @throws as RealTime.
std::vector<std::string> missing_for_real_time(const RealTimeOptions& options);

}  // namespace stageid
