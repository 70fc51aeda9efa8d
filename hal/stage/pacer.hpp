#pragma once

#include <cstdint>

#include "hal/stage/stage.hpp"

namespace stageid {

/// Time of CLOCK_MONOTONIC.
std::int64_t monotonic_ns() noexcept;

/// Waits for sample instants. It sleeps until shortly before and then spins, because a sleeping thread wakes up
/// tens of microseconds late and a spinning one blocks others.
class Pacer {
 public:
  /// @param pace 0: virtual time, no waiting; otherwise stage seconds per second of wall clock.
  Pacer(double sample_rate_hz, double pace) noexcept;

  struct Instant {
    std::int64_t sample_ns = 0;  ///< the sample instant on the stage's clock
    std::int64_t now_ns = 0;     ///< end of the wait
    std::int64_t ready_ns = 0;   ///< start of the wait; 0 in virtual time
    bool late = false;           ///< the instant had passed before the wait began

    /// Whether the cycle is late, also by the deadline of its exchange.
    bool too_late(Deadline deadline) const noexcept {
      return late || (deadline.t_ns != 0 && now_ns > deadline.t_ns);
    }
    /// Sets number and times of a measurement.
    void put(std::uint64_t cycle, Inputs& inputs) const noexcept {
      inputs.cycle = cycle;
      inputs.t_sample_ns = sample_ns;
      inputs.t_rx_ns = now_ns;
      inputs.t_ready_ns = ready_ns;
    }
  };

  /// The first sample instant: now, or zero in virtual time.
  Instant restart() noexcept;
  /// Waits for the next instant. If whole periods were missed, the schedule is shifted by them: the phase is
  /// kept, and samples are not caught up.
  Instant wait() noexcept;

 private:
  double period_ns_;
  std::int64_t spin_ns_;
  bool wall_;
  std::int64_t origin_ns_ = 0;
  std::uint64_t index_ = 0;
};

}  // namespace stageid
