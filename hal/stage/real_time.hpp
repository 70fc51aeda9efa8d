#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "excitation/words/words.hpp"

namespace stageid {

enum class RealTimePolicy : std::uint8_t {
  off,      ///< keep normal scheduling
  attempt,  ///< use what is available and report what is missing
  require   ///< refuse to run without permissions or without a PREEMPT_RT kernel
};
template <>
inline constexpr std::array kWords<RealTimePolicy> = {"off", "try", "require"};

/// Scheduling of the loop's thread. Ignored in virtual time.
struct RealTimeOptions {
  RealTimePolicy policy = RealTimePolicy::off;
  int priority = 80;        ///< of SCHED_FIFO, 1 to 99
  int cpu = -1;             ///< processor to which the loop is pinned; -1: not pinned
  bool lock_memory = true;  ///< keeps the process's pages out of the swap
};

/// Whether the kernel is fully preemptible. `version`: output of uname -v. `flag`: content of
/// /sys/kernel/realtime (empty if the file does not exist).
bool is_preempt_rt(std::string_view version, std::string_view flag) noexcept;

/// Gives the calling thread normal scheduling: what works beside the loop must not inherit its priority.
void take_normal_priority() noexcept;

/// During its lifetime, the creating thread is a real-time thread: SCHED_FIFO, pinned, wake-ups without timer
/// slack, memory of the process locked. Pages are locked when first touched, so that unused parts of the
/// threads' stacks are not.
///
/// The destructor unlocks the memory. Priority and processor remain with the thread until it ends.
class RealTime {
 public:
  /// @throws StageError with policy `require` if something is missing; the message contains the remedy.
  /// @throws std::invalid_argument for a priority outside 1 to 99 or a missing processor.
  explicit RealTime(const RealTimeOptions& options);
  ~RealTime();
  RealTime(RealTime&&) = delete;

  /// Unavailable settings with their remedies, one line each.
  const std::vector<std::string>& missing() const noexcept { return missing_; }

 private:
  std::vector<std::string> missing_;
  bool locked_ = false;
};

/// The missing() of a RealTime in a short-lived thread, to check before anything is started.
/// @throws as RealTime.
std::vector<std::string> missing_for_real_time(const RealTimeOptions& options);

}  // namespace stageid
