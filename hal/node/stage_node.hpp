#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "hal/node/node_state_machine.hpp"
#include "hal/stage/limited_stage.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/stage.hpp"
#include "hal/stage/supervisor.hpp"

namespace stageid {

struct NodeOptions {
  /// Longest permitted silence of the host while it measures; 0: 3 samples.
  double watchdog_s = 0.0;
  /// Time for which the node's own controller holds the stage before power is cut.
  double hold_s = 0.1;
};

/// Simulated environment of the stage, for simulated disturbances.
struct NodePanel {
  bool interlock_closed = true;
  std::vector<double> gravity_compensator_n;  ///< force of each
  std::vector<double> temperature_k;
  double gravity_low_n = 0.0;  ///< permitted range of each
  double gravity_high_n = 0.0;
  double temperature_high_k = 0.0;
};

/// A stage behind a fieldbus, without the bus: plant, state machine, watchdog, safe stop. Front ends (CAN,
/// Modbus) of one process share it; every call takes its lock.
///
/// While the host measures, each advance() moves the plant by one sample. The node stops by itself if
///   - no advance() is called for watchdog_s (of the wall clock, checked by tick());
///   - advance() reports a limit or a fault;
///   - its own loop misses six measurements in a row, by a leaky bucket like the host's;
///   - the panel leaves its range; or
///   - fail() is called.
/// Its own controller holds the stage for hold_s in closed loop; if the loop is unsound, LimitedStage brakes the
/// stage. Then forces become zero, and the state is fault until an explicit reset. A quick stop does the
/// same but ends in switch_on_disabled.
///
/// During the host's silence, the last force acts on, and the limits are watched. The samples of this time are
/// played when the watchdog expires, because the setpoints are the clock of a simulated stage.
///
/// The node's controller is updated at every sample, so that taking over causes no step other than the end
/// of the excitation.
class StageNode {
 public:
  /// The stage must not wait in exchange() (pace 0): it is called under the lock.
  /// @throws std::invalid_argument if controller or limits do not fit the stage, or an option is
  /// negative.
  StageNode(std::unique_ptr<CyclicStage> stage, const StageLimits& limits,
            const MotionControllerSpec& controller, NodePanel panel, const NodeOptions& options);

  const StageInfo& info() const noexcept { return stage_.info(); }
  NodeState state() const {
    return locked([&] { return machine_.state(); });
  }
  FaultCause cause() const {
    return locked([&] { return machine_.cause(); });
  }
  /// Reason of the fault in one line; empty if there is none.
  std::string trouble() const;
  /// Of the current run, without those of a safe stop.
  std::uint64_t sample() const {
    return locked([&] { return sample_; });
  }
  NodePanel panel() const {
    return locked([&] { return panel_; });
  }
  /// Takes effect with the next tick().
  void set_panel(NodePanel panel) {
    locked([&] { panel_ = std::move(panel); });
  }

  /// enable and reset_fault are refused while the panel is out of range; the reply contains the reason.
  SupervisorReply request(SupervisorCommand command);

  /// Key of the host that owns the stage by a run or reservation; 0: none.
  std::uint32_t session() const {
    return locked([&] { return holder(); });
  }
  /// Reserves the stage for one host until its run ends, it is released, or it is no longer enabled.
  /// @return a new key. @throws StageError if another host owns the stage.
  std::uint32_t reserve();
  /// Ends a reservation.
  void release() {
    locked([&] { reserved_ = false; });
  }

  /// operation_enabled -> measuring; y[0] into `first.y` (size sensors). `session`: key of a reservation,
  /// or 0. @return the key of the run.
  /// @throws StageError in any other state, if another host owns the stage, or if the stage refuses.
  std::uint32_t begin_run(std::uint64_t run_seed, std::int64_t now_ns, Inputs& first,
                          std::uint32_t session = 0);
  /// u[n] -> y[n+1]. Outcome::fault unless measuring.
  [[nodiscard]] Outcome advance(std::int64_t now_ns, std::span<const double> u, Inputs& inputs) {
    return locked([&] { return exchange(now_ns, u, inputs); });
  }
  /// The same with u[n] = C(y[n]) + r[n] of the node's own controller; writes u[n] to `u`.
  [[nodiscard]] Outcome advance_excited(std::int64_t now_ns, std::span<const double> r,
                                        std::span<double> u, Inputs& inputs);
  /// measuring -> operation_enabled, forces zero. The stage may remain reserved for the host of the run, with the same
  /// key.
  void end_run(bool keep_reserved = false);

  /// Reports a failure outside of the stage (bus, heartbeat): safe stop, then fault.
  void fail(FaultCause cause) {
    locked([&] { machine_.fail(cause); });
  }

  /// Watchdog, panel and safe stop; to be called at least every millisecond. `now_ns`:
  /// CLOCK_MONOTONIC, the same clock as in the calls above.
  void tick(std::int64_t now_ns);

 private:
  template <typename Call>
  std::invoke_result_t<Call> locked(Call call) const {
    const std::lock_guard lock(mutex_);
    return call();
  }
  Outcome exchange(std::int64_t now_ns, std::span<const double> u, Inputs& inputs);
  void give_nothing(Inputs& inputs) const;
  std::uint32_t holder() const;
  std::uint32_t draw_key();
  bool lost(Outcome outcome) noexcept;
  void hold(std::int64_t now_ns);
  std::int64_t samples_in(std::int64_t time_ns) const;
  void come_to_rest();

  // One lock for all state: the node's timing does not affect the host's.
  mutable std::mutex mutex_;
  LimitedStage stage_;
  MotionController controller_;
  NodeStateMachine machine_;
  NodePanel panel_;
  std::int64_t watchdog_ns_ = 0;
  std::int64_t hold_ns_ = 0;

  std::random_device random_;
  std::uint32_t session_ = 0;  // of the last run or reservation
  bool reserved_ = false;
  bool running_ = false;  // the stage is started: forces act in closed loop
  std::uint64_t sample_ = 0;
  std::int64_t last_sample_ns_ = 0;
  std::optional<std::int64_t> hold_began_ns_;
  std::int64_t held_samples_ = 0;    // those of the silence included
  std::int64_t silent_samples_ = 0;  // of the host, before the hold
  int bucket_ = 0;                   // of missing measurements, while the node's own loop controls
  std::string reason_;               // of the fault, if more is known than its cause
  std::vector<double> y_;
  std::vector<double> control_;  // C(y) of the node's controller
  std::vector<double> command_;
};

}  // namespace stageid
