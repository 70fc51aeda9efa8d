#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "hal/stage/supervisor.hpp"

namespace stageid {

/// Conditions that must hold while forces may act.
struct PlantConditions {
  double stale_s = 0.3;  ///< largest age of a snapshot: three poll periods
  double gravity_low_n = 0.0;
  double gravity_high_n = 0.0;
  double temperature_low_k = 0.0;
  double temperature_high_k = 0.0;
  double enable_s = 5.0;  ///< longest time for enabling
};

/// "gravity compensator 2: 12 N is out of range (40 to 60 N)"; empty if all are in range. NaN is out of range.
std::string range_trouble(const std::vector<double>& values, double low, double high,
                          const char* what, const char* unit);

/// One line: the most serious violated condition; empty if all hold. It does not check whether the stage is
/// enabled.
std::string plant_trouble(const PlantSnapshot& snapshot, const PlantConditions& conditions,
                          std::int64_t now_ns);

/// Enables the plant, monitors it, and disables it at the end.
///
/// tripped() is a lock-free flag for a real-time loop. It is set permanently as soon as a condition no longer
/// holds or the plant is no longer enabled.
class PlantWatch {
 public:
  /// Waits for a fresh snapshot in which all conditions hold, enables the plant, and monitors it in a separate
  /// thread. A fault is cleared first if `reset_fault`. `supervisor` must outlive the watch.
  /// @throws StageError naming the violated condition, or the reason why the plant cannot be enabled.
  /// @throws std::invalid_argument if a condition is NaN or a range is empty.
  PlantWatch(Supervisor& supervisor, const PlantConditions& conditions, bool reset_fault = false);
  /// Disables the plant.
  ~PlantWatch();

  const std::atomic<bool>& tripped() const noexcept { return tripped_; }
  /// The reason for tripping; empty unless tripped().
  std::string reason() const;

 private:
  std::string wait_until_good(bool enabled);
  void watch(const std::stop_token& stop);

  Supervisor& supervisor_;
  PlantConditions conditions_;
  std::atomic<bool> tripped_ = false;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::string reason_;
  std::jthread thread_;  // last: it uses all other members
};

}  // namespace stageid
