#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "acquisition/record/log_info.hpp"
#include "excitation/plan/experiment_plan.hpp"

namespace stageid {

/// A value that one thread replaces while others read it, without a lock. Each of its words is exact, but they may be
/// of different replacements.
template <typename Value>
class SharedWords {
 public:
  void store(const Value& value) noexcept {
    const auto words = std::bit_cast<Words>(value);
    for (std::size_t i = 0; i < words.size(); ++i)
      words_[i].store(words[i], std::memory_order_relaxed);
  }
  Value load() const noexcept {
    Words words;
    for (std::size_t i = 0; i < words.size(); ++i)
      words[i] = words_[i].load(std::memory_order_relaxed);
    return std::bit_cast<Value>(words);
  }

 private:
  using Words = std::array<std::uint64_t, sizeof(Value) / sizeof(std::uint64_t)>;
  std::array<std::atomic<std::uint64_t>, std::tuple_size_v<Words>> words_{};
};

/// The state of the current run, for the reporting thread.
struct SharedProgress {
  SharedWords<RunHealth> health;
  SharedWords<RunTiming> timing;  ///< on the wall clock
  std::atomic<int> realization = 0;
  std::atomic<int> experiment = 0;
  std::atomic<int> runs_begun = 0;
  std::atomic<int> runs_done = 0;

  void publish(const RunHealth& of_health, const RunTiming& of_timing, bool wall) noexcept {
    health.store(of_health);
    if (wall) timing.store(of_timing);
  }
  void begin(RunId run, bool wall) noexcept {
    publish({}, {}, wall);
    runs_begun.fetch_add(1, std::memory_order_relaxed);
    realization.store(run.realization, std::memory_order_relaxed);
    experiment.store(run.experiment, std::memory_order_relaxed);
  }
};

}  // namespace stageid
