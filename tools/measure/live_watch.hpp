#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <thread>

#include "tools/watch/stage_watch.hpp"

namespace stageid {

/// Watches a stage while it is measured, from the log only, in a thread of lowest priority. A failure ends the watch, not
/// the measurement.
class LiveWatch {
 public:
  /// Starts to follow the log. @param watch must outlive *this
  LiveWatch(StageWatch& watch, std::filesystem::path log);
  ~LiveWatch();
  LiveWatch(const LiveWatch&) = delete;
  LiveWatch& operator=(const LiveWatch&) = delete;

  /// To be called when nothing more is written. Returns when all of a closed log was watched, or after an interrupt.
  /// @returns why the watch failed; empty if it did not
  std::string finish(bool log_is_closed);

 private:
  std::atomic<bool> stop_ = false;
  std::string failure_;
  std::thread thread_;  // last: it uses all other members
};

}  // namespace stageid
