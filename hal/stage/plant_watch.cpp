#include "hal/stage/plant_watch.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "excitation/words/require.hpp"
#include "hal/stage/pacer.hpp"

namespace stageid {
namespace {

using Seconds = std::chrono::duration<double>;

constexpr double kLooksAWindow = 10.0;  // checks of the snapshot per stale_s

void check(const PlantConditions& c) {
  require(c.stale_s > 0.0 && std::isfinite(c.stale_s) && c.enable_s > 0.0 &&
              std::isfinite(c.enable_s) && c.gravity_low_n <= c.gravity_high_n &&
              c.temperature_low_k <= c.temperature_high_k,
          "supervisor: times must be positive, and ranges [low, high] must have low <= high");
}

/// Trouble of the current snapshot; `enabled`: the plant must also be enabled.
std::string trouble_of(const Supervisor& supervisor, const PlantConditions& conditions,
                       bool enabled) {
  const PlantSnapshot snapshot = supervisor.snapshot();
  std::string trouble = plant_trouble(snapshot, conditions, monotonic_ns());
  const bool stale = snapshot.t_ns == 0 || !trouble.empty();
  if (stale) {
    const std::string link = supervisor.trouble();
    const bool of_link = !link.empty() && static_cast<double>(monotonic_ns() - snapshot.t_ns) >
                                              1e9 * conditions.stale_s;
    return of_link ? fmt::format("{}; {}", trouble, link) : trouble;
  }
  if (enabled && !snapshot.enabled)
    return fmt::format("the plant is not enabled (state {})", to_string(snapshot.state));
  return "";
}

}  // namespace

std::string range_trouble(const std::vector<double>& values, double low, double high,
                          const char* what, const char* unit) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!(values[i] >= low && values[i] <= high))
      return fmt::format("{} {}: {:.4g} {} is out of range ({:.4g} to {:.4g} {})", what, i + 1,
                         values[i], unit, low, high, unit);
  return "";
}

std::string plant_trouble(const PlantSnapshot& snapshot, const PlantConditions& conditions,
                          std::int64_t now_ns) {
  if (snapshot.t_ns == 0) return "supervisor: no status has been read yet";
  const double age_s = 1e-9 * static_cast<double>(now_ns - snapshot.t_ns);
  if (age_s > conditions.stale_s)
    return fmt::format("supervisor: the status is older than {:.3g} s", conditions.stale_s);
  if (!snapshot.interlock_closed) return "the interlock is open; close it";
  std::string gravity = range_trouble(snapshot.gravity_compensator_n, conditions.gravity_low_n,
                                      conditions.gravity_high_n, "gravity compensator", "N");
  if (!gravity.empty()) return gravity;
  std::string temperature = range_trouble(snapshot.temperature_k, conditions.temperature_low_k,
                                          conditions.temperature_high_k, "temperature", "K");
  if (!temperature.empty()) return temperature;
  if (snapshot.state == NodeState::fault || snapshot.state == NodeState::fault_reaction)
    return fmt::format("the plant is in fault: {}; remove the cause and add --reset-fault",
                       to_string(snapshot.cause));
  return "";
}

PlantWatch::PlantWatch(Supervisor& supervisor, const PlantConditions& conditions, bool reset_fault)
    : supervisor_(supervisor), conditions_(conditions) {
  check(conditions);
  if (reset_fault) {
    static_cast<void>(wait_until_good(false));
    if (supervisor_.snapshot().state == NodeState::fault)
      static_cast<void>(supervisor_.request(SupervisorCommand::reset_fault));
  }
  std::string trouble = wait_until_good(false);
  if (!trouble.empty()) throw StageError(trouble);
  const SupervisorReply reply = supervisor_.request(SupervisorCommand::enable);
  require<StageError>(reply.accepted, "the plant cannot be enabled: {}", reply.message);
  trouble = wait_until_good(true);
  if (!trouble.empty()) {
    supervisor_.request(SupervisorCommand::disable);
    throw StageError(trouble);
  }
  thread_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

PlantWatch::~PlantWatch() {
  thread_ = {};  // stops it and waits for it
  supervisor_.request(SupervisorCommand::disable);
}

/// Waits up to enable_s. @returns the remaining trouble; empty if there is none.
std::string PlantWatch::wait_until_good(bool enabled) {
  const std::int64_t until_ns = monotonic_ns() + std::llround(1e9 * conditions_.enable_s);
  while (true) {
    std::string trouble = trouble_of(supervisor_, conditions_, enabled);
    if (trouble.empty() || monotonic_ns() > until_ns) return trouble;
    // Waiting does not change the panel's values, but links come up and states change.
    const PlantSnapshot snapshot = supervisor_.snapshot();
    const bool fresh = snapshot.t_ns != 0 && static_cast<double>(monotonic_ns() - snapshot.t_ns) <
                                                 1e9 * conditions_.stale_s;
    if (fresh && !enabled) return trouble;
    std::this_thread::sleep_for(Seconds(conditions_.stale_s / kLooksAWindow));
  }
}

void PlantWatch::watch(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  const auto never = [] { return false; };
  while (true) {
    changed_.wait_for(lock, stop, Seconds(conditions_.stale_s / kLooksAWindow), never);
    if (stop.stop_requested()) return;
    lock.unlock();
    std::string trouble = trouble_of(supervisor_, conditions_, true);
    lock.lock();
    if (trouble.empty()) continue;
    reason_ = std::move(trouble);
    tripped_.store(true, std::memory_order_release);
    return;
  }
}

std::string PlantWatch::reason() const {
  const std::lock_guard lock(mutex_);
  return reason_;
}

}  // namespace stageid
