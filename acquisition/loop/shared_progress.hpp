#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "acquisition/record/log_info.hpp"
#include "excitation/plan/experiment_plan.hpp"

namespace stageid {

/// Counts of the current run, shared by the loop with the reporting thread through relaxed atomics. Each number is
/// exact, but they may be some cycles apart.
class SharedProgress {
 public:
  /// Publishes the timing too for a run on the wall clock.
  void publish(const RunHealth& health, const RunTiming& timing, bool wall) noexcept {
    for (std::size_t i = 0; i < kCounts.size(); ++i) store(i, health.*kCounts[i]);
    store(4, static_cast<std::uint64_t>(health.largest_lateness_ns));
    if (!wall) return;
    store(5, timing.skipped);
    for (std::size_t bin = 0; bin < TimingHistogram::kBins; ++bin) {
      store(kFirstBin + bin, timing.execution.count(bin));
      store(kFirstBin + TimingHistogram::kBins + bin, timing.lateness.count(bin));
    }
  }
  RunHealth health() const noexcept {
    RunHealth health;
    for (std::size_t i = 0; i < kCounts.size(); ++i) health.*kCounts[i] = load(i);
    health.largest_lateness_ns = static_cast<std::int64_t>(load(4));
    return health;
  }
  RunTiming timing() const {
    RunTiming timing;
    timing.skipped = load(5);
    for (std::size_t bin = 0; bin < TimingHistogram::kBins; ++bin) {
      timing.execution.add_bin(bin, load(kFirstBin + bin));
      timing.lateness.add_bin(bin, load(kFirstBin + TimingHistogram::kBins + bin));
    }
    return timing;
  }
  void begin(RunId run, bool wall) noexcept {
    publish({}, {}, wall);
    runs_begun.fetch_add(1, std::memory_order_relaxed);
    realization.store(run.realization, std::memory_order_relaxed);
    experiment.store(run.experiment, std::memory_order_relaxed);
  }
  std::atomic<int> realization = 0;
  std::atomic<int> experiment = 0;
  std::atomic<int> runs_begun = 0;
  std::atomic<int> runs_done = 0;

 private:
  static constexpr std::array kCounts = {&RunHealth::cycles, &RunHealth::late, &RunHealth::missing,
                                         &RunHealth::marked};
  static constexpr std::size_t kFirstBin = 6;
  void store(std::size_t i, std::uint64_t value) noexcept {
    counts_[i].store(value, std::memory_order_relaxed);
  }
  std::uint64_t load(std::size_t i) const noexcept {
    return counts_[i].load(std::memory_order_relaxed);
  }
  std::array<std::atomic<std::uint64_t>, kFirstBin + 2 * TimingHistogram::kBins> counts_{};
};

}  // namespace stageid
