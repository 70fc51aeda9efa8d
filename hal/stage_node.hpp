#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "hal/limited_stage.hpp"
#include "hal/motion_controller.hpp"
#include "hal/node_state_machine.hpp"
#include "hal/stage.hpp"
#include "hal/supervisor.hpp"

namespace stageid {

struct NodeOptions {
  double watchdog_s = 0.0;  ///< the host may be silent for so long while it measures; 0: 3 samples
  double hold_s =
      0.1;  ///< the node's own controller holds the stage for so long before power is cut
};

/// What stands around the simulated stage and can be disturbed on request.
struct NodePanel {
  bool interlock_closed = true;
  std::vector<double> gravity_compensator_n;  ///< force of each
  std::vector<double> temperature_k;
  double gravity_low_n = 0.0;  ///< allowed range of each
  double gravity_high_n = 0.0;
  double temperature_high_k = 0.0;
};

/// A stage behind wires, without the wires: plant, state machine, watchdog, safe stop. Front ends
/// (CAN, Modbus) of one process share it; every call takes its lock.
///
/// While the host measures, each advance() moves the plant by one sample. If none comes for
/// watchdog_s (of the wall clock, seen by tick()), or advance() reports a limit or a fault, or the
/// panel leaves its range, the node stops by itself: its own controller holds the stage for hold_s
/// in closed loop, then forces go to zero, and the state is fault until an explicit reset.
class StageNode {
 public:
  /// @throws std::invalid_argument if controller or limits do not fit the stage.
  StageNode(std::unique_ptr<CyclicStage> stage, const StageLimits& limits,
            const MotionControllerSpec& controller, NodePanel panel, const NodeOptions& options);

  const StageInfo& info() const noexcept { return stage_.info(); }
  NodeState state() const;
  FaultCause cause() const;
  std::uint64_t sample() const;  ///< of the current run
  NodePanel panel() const;
  void set_panel(NodePanel panel);

  /// enable and reset_fault are refused while the panel is out of range; the reply says what.
  SupervisorReply request(SupervisorCommand command);

  /// operation_enabled -> measuring; y[0] into `first.y` (size sensors).
  /// @throws StageError in any other state.
  void begin_run(std::uint64_t run_seed, std::int64_t now_ns, Inputs& first);
  /// u[n] -> y[n+1]. Outcome::fault unless measuring.
  [[nodiscard]] Outcome advance(std::int64_t now_ns, std::span<const double> u, Inputs& inputs);
  /// measuring -> operation_enabled, forces zero.
  void end_run();

  /// Watchdog, panel and safe stop; to be called at least every millisecond. `now_ns`:
  /// CLOCK_MONOTONIC, the same clock as in the calls above.
  void tick(std::int64_t now_ns);

 private:
  // One lock for all of it: a node's own time is not the host's.
  mutable std::mutex mutex_;
  LimitedStage stage_;
  MotionController controller_;
  NodeStateMachine machine_;
  NodePanel panel_;
  NodeOptions options_;
};

}  // namespace stageid
