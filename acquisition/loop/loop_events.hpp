#pragma once

#include <cstdint>
#include <optional>

#include "acquisition/loop/sample_ring.hpp"

namespace stageid {

/// An event inside a run, reported by another thread.
struct LoopEvent {
  enum class Kind : std::uint8_t {
    state,  ///< the state of the stage has changed; code: NodeState
    stop    ///< the run is stopped early; code: StopReason
  };
  int run = 0;              ///< number of runs that this loop started before
  std::uint64_t cycle = 0;  ///< of the run
  Kind kind = Kind::state;
  std::uint8_t code = 0;
};

/// Lock-free queue from the loop to one other thread. If it is full, events are dropped, because the loop must
/// not wait.
class LoopEvents {
 public:
  void push(const LoopEvent& event) noexcept {
    double* const row = ring_.reserve();
    if (row == nullptr) return;
    row[0] = event.run;
    row[1] = static_cast<double>(event.cycle);
    row[2] = static_cast<double>(event.kind);
    row[3] = event.code;
    ring_.commit();
  }

  std::optional<LoopEvent> pop() noexcept {
    const std::span<const double> row = ring_.front(1);
    if (row.empty()) return std::nullopt;
    const LoopEvent event{static_cast<int>(row[0]), static_cast<std::uint64_t>(row[1]),
                          static_cast<LoopEvent::Kind>(row[2]), static_cast<std::uint8_t>(row[3])};
    ring_.pop(1);
    return event;
  }

 private:
  SampleRing ring_{4, 256};
};

}  // namespace stageid
