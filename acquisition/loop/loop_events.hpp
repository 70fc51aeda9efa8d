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
    LoopEvent* const slot = ring_.reserve();
    if (slot == nullptr) return;
    *slot = event;
    ring_.commit();
  }

  std::optional<LoopEvent> pop() noexcept {
    const std::span<const LoopEvent> oldest = ring_.front(1);
    if (oldest.empty()) return std::nullopt;
    const LoopEvent event = oldest.front();
    ring_.pop(1);
    return event;
  }

 private:
  RowRing<LoopEvent> ring_{1, 256};
};

}  // namespace stageid
