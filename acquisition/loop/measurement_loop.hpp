#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "acquisition/loop/loop_events.hpp"
#include "acquisition/loop/sample_ring.hpp"
#include "acquisition/record/log_info.hpp"
#include "acquisition/slog/slog_format.hpp"
#include "excitation/words/words.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/sample_clock.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

struct LoopOptions {
  double ramp_s = 0.1;  ///< ramp of the excitation to zero before the stage is stopped
  /// Samples whose instant deviates by more are marked; 0: not checked. Only on the wall clock, of stages that stamp
  /// their samples.
  double jitter_s = 0.0;
  /// Samples that deviate by more than this are also marked once they would raise the rms deviation of the run beyond
  /// it; 0: not checked. Needs jitter_s.
  double jitter_rms_s = 0.0;
  int misses_allowed = 10;  ///< leaky bucket: +2 per bad cycle, -1 per good one; above this: stop
  BetweenRuns between_runs = BetweenRuns::release;
};

/// Signals that are added to the actuators, and their duration.
struct LoopExcitation {
  Eigen::MatrixXd period;      ///< one period, samples x columns
  std::vector<int> actuators;  ///< index of the actuator of each column
  std::uint64_t samples = 0;   ///< total number to measure
};

/// A LoopExcitation as the loop needs it.
struct PreparedExcitation {
  std::vector<double> rows;  ///< sample by sample, without columns of zeros
  std::vector<std::size_t> actuators;
  std::uint64_t period_samples = 1;
  std::uint64_t samples = 0;
};

enum class LoopStatus : std::uint8_t {
  running,
  held,       ///< the run is over and the controller keeps the stage; see next() and release()
  ring_full,  ///< nothing was done; call again after the log thread has freed a row
  ended       ///< the stage is stopped; see reason()
};

/// Why a run ended early.
enum class StopReason : std::uint8_t { none, limit, fault, misses, interrupt, log, plant };
template <>
inline constexpr std::array kWords<StopReason> = {"none",      "limit", "fault", "misses",
                                                  "interrupt", "log",   "plant"};

/// One closed-loop run, cycle by cycle:  u[n] = C(y[n]) + g r[n],  exchange(u[n]) -> y[n+1].
///
/// Every cycle pushes one row, u[n], y[n], status (slog_format.hpp), into the ring. The outcome in the status is
/// that of the exchange that returned y[n]. The row is marked if that was not `ok`, if the exchange of u[n]
/// failed (it may not have been applied), or in the ramp of a controlled stop. Sensors that are missing or not
/// finite keep their last value, marked.
///
/// g is 1. After its last sample, or after a stop (a limit, too many misses, a request), a run continues in
/// closed loop while g falls linearly to 0 over ramp_s; then the stage is stopped. The ramp of a good run is not
/// recorded, so that a log has whole periods; that of a stop is recorded, marked. A fault, bus-off or lost
/// link ends the run at once, because control is impossible. So does a stage that has opened the loop
/// (LimitedStage), once it has braked. A row contains the applied u, even if it differs from the command.
///
/// A stage that stamps its samples is also watched for jitter: a row whose instant deviates by more than jitter_s
/// from the followed clock (SampleClock) is marked as irregular, and does not count in the bucket. With jitter_rms_s, so
/// is a row whose squared deviation exceeds what the run has left of samples * jitter_rms_s^2.
///
/// Held between runs (BetweenRuns::hold), the loop stays closed after that ramp, unrecorded, with the same limits and
/// reasons to stop. The next run begins without a step: before its first sample, r rises linearly over ramp_s, with
/// the phase that the period continues. A feed-forward of the controller rises before that, when the loop is closed.
///
/// Bucket: late cycles count as bad (their samples are valid, but the phase of the loop is wrong).
class MeasurementLoop {
 public:
  /// All memory is allocated here and in start(). References are kept.
  /// @throws std::invalid_argument if controller, ring and stage differ in channels, there are more
  ///         than 64 sensors, or an option is negative.
  MeasurementLoop(CyclicStage& stage, MotionController& controller, SampleRing& ring,
                  const LoopOptions& options = {});

  /// Starts the stage and the run. @throws StageError from the stage. @throws std::invalid_argument
  /// on sizes, an actuator that does not exist, or an excitation that is not finite.
  void start(std::uint64_t run_seed, const LoopExcitation& excitation);

  /// What start() computes from an excitation, for next(). May be called from another thread during a run.
  PreparedExcitation prepare(const LoopExcitation& excitation) const;
  /// Begins the next run while the stage is held. Swaps, so that nothing is allocated or freed.
  void next(PreparedExcitation& excitation) noexcept;
  /// Ends holding: opens the loop, also if a stop was requested meanwhile.
  void release() noexcept;
  bool holding() const noexcept { return phase_ == Phase::holding; }
  bool ended() const noexcept { return phase_ == Phase::idle; }

  /// One cycle. Does not allocate, lock, log or throw. There is no system call other than the exchange's; on a
  /// wall clock it reads the time twice for timing().
  [[nodiscard]] LoopStatus step() noexcept;

  /// Begins a controlled stop; a second one is ignored. In the ramp after the last sample, only a limit is accepted,
  /// unless the stage is to be held. Call it from the thread that calls step().
  void request_stop(StopReason reason) noexcept;

  StopReason reason() const noexcept { return reason_; }
  /// True once all samples are recorded (a limit or a fault may still end the following ramp).
  bool complete() const noexcept { return complete_; }
  /// The last bad outcome of the run, which may have ended it.
  Outcome last_trouble() const noexcept { return last_trouble_; }
  /// Of the current run; the caller sets `seconds`.
  const RunHealth& health() const noexcept { return health_; }
  /// Of the current run; empty in virtual time.
  const RunTiming& timing() const noexcept { return timing_; }
  /// State changes and stops of all runs so far; only one other thread may call pop().
  LoopEvents& events() noexcept { return events_; }

 private:
  enum class Phase : std::uint8_t { idle, leading, measuring, stopping, landing, holding };

  void begin(std::uint64_t quiet_samples) noexcept;
  void lead() noexcept;

  void compute_command() noexcept;
  bool write_row(double* row) noexcept;
  void take_measurement(Outcome outcome) noexcept;
  void hold_missing(std::uint64_t valid) noexcept;
  void count_bad_cycle(Outcome outcome) noexcept;
  void time_cycle(std::int64_t computed_ns, Outcome outcome) noexcept;
  void judge_instant(std::int64_t sent_ns) noexcept;
  bool regular(std::int64_t deviation_ns) noexcept;
  void tell_state() noexcept;
  void tell(LoopEvent::Kind kind, std::uint8_t code) noexcept;
  void end(StopReason reason) noexcept;
  LoopStatus advance() noexcept;
  bool recording() const noexcept {
    return phase_ == Phase::measuring || phase_ == Phase::stopping;
  }

  CyclicStage& stage_;
  MotionController& controller_;
  SampleRing& ring_;
  std::uint64_t ramp_samples_;
  int misses_allowed_;
  bool wall_clock_;
  std::int64_t period_ns_;

  std::vector<double> u_;
  std::vector<double> y_;
  std::vector<double> fresh_;          // y[n+1] as returned by the stage
  std::vector<double> last_finite_u_;  // logged if a command is not finite
  PreparedExcitation excitation_;
  std::vector<double> landing_row_;
  Inputs inputs_;

  bool hold_ = false;
  std::uint64_t phase_sample_ = 0;  // n mod period
  std::uint64_t cycle_ = 0;         // of the stage, since the loop was closed
  std::uint64_t sample_ = 0;        // of the run
  std::uint64_t quiet_left_ = 0;    // samples until the excitation begins to rise
  std::uint64_t ramp_left_ = 0;
  double gain_ = 1.0;
  SampleStatus status_;  // of y_
  SampleStamp stamp_;    // of y_
  bool stamps_;          // whether rows have them
  bool sets_pace_;
  std::int64_t jitter_ns_;
  double jitter_ns2_;           // mean square; 0: any
  double jitter_left_ns2_ = 0;  // sum that the samples of the run may still have
  SampleClock clock_;
  int bucket_ = 0;
  Phase phase_ = Phase::idle;
  bool complete_ = false;
  StopReason reason_ = StopReason::none;
  Outcome last_trouble_ = Outcome::ok;
  RunHealth health_;
  RunTiming timing_;
  std::int64_t awake_ns_ = 0;  // time at which the loop received y_
  NodeState node_state_ = NodeState::not_ready;
  int run_ = -1;
  LoopEvents events_;
};

}  // namespace stageid
