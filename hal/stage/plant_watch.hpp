#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

#include "hal/stage/supervisor.hpp"

namespace stageid {

/// What must hold around the stage while forces may act.
struct PlantConditions {
  double stale_s = 0.3;  ///< an older snapshot is worth nothing: three poll periods
  double gravity_low_n = 0.0;
  double gravity_high_n = 0.0;
  double temperature_low_k = 0.0;
  double temperature_high_k = 0.0;
  double enable_s = 5.0;  ///< enabling may take so long
};

/// One line: what of the conditions does not hold, the most serious first; empty if all do.
/// Whether the stage is enabled is no part of it.
std::string plant_trouble(const PlantSnapshot& snapshot, const PlantConditions& conditions,
                          std::int64_t now_ns);

/// Brings the plant up, watches it, takes it down again.
///
/// tripped() is a flag that a real-time loop may look at in every cycle: no lock stands behind it.
/// It is set at once when a condition no longer holds or the plant is no longer enabled, and stays.
class PlantWatch {
 public:
  /// Waits for a fresh snapshot in which all conditions hold, enables the plant, waits for it, and
  /// watches it in a thread of its own. A fault is cleared first if `reset_fault`. `supervisor` must outlive the watch.
  /// @throws StageError that says which condition does not hold, or why it cannot be enabled.
  /// @throws std::invalid_argument if a condition is no number or a range is empty.
  PlantWatch(Supervisor& supervisor, const PlantConditions& conditions, bool reset_fault = false);
  /// Disables the plant.
  ~PlantWatch();
  PlantWatch(const PlantWatch&) = delete;
  PlantWatch& operator=(const PlantWatch&) = delete;

  const std::atomic<bool>& tripped() const noexcept { return tripped_; }
  /// Why; empty unless tripped().
  std::string reason() const;

 private:
  void clear_fault();
  std::string wait_until_good(bool enabled);
  void watch();

  Supervisor& supervisor_;
  PlantConditions conditions_;
  std::atomic<bool> tripped_ = false;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::string reason_;
  bool stop_ = false;
  std::thread thread_;  // last: it uses all the others
};

}  // namespace stageid
