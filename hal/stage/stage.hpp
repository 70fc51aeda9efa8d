#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"

namespace stageid {

/// The machine or its link failed. Exit code 1.
class StageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One actuator or sensor. Its values are in its unit; positions are in metres.
struct Channel {
  std::string name;
  std::string unit;  ///< "N", "Nm", "A", "V"; "m", "rad", "m/s^2", "rad/s^2", "V"
  double position_m[3] = {0., 0., 0.};  ///< on the stage, centre of mass = origin
  double direction[3] = {0., 0., 1.};   ///< unit vector; of a rotation: its axis
  /// Of an actuator: N or Nm per unit; of a sensor: units per m or rad, or per m/s^2 or rad/s^2.
  double gain = 1.0;
};

/// Whether a channel is a torque, or measures a rotation: by its unit.
bool is_rotation(const Channel& channel) noexcept;
/// Whether a sensor measures acceleration: by its unit.
bool is_acceleration(const Channel& channel) noexcept;
/// The unit of all these channels with a blank before it; empty if they have several.
std::string common_unit(const std::vector<Channel>& channels);

/// One pass without a branch per value.
bool all_finite(std::span<const double> values) noexcept;

/// Index of the channel of that name, -1 if there is none.
int channel_index(const std::vector<Channel>& channels, const std::string& name) noexcept;

enum class Clock : std::uint8_t { virtual_time, wall };
template <>
inline constexpr std::array kWords<Clock> = {"virtual", "wall"};

/// What happens to the stage between the runs of an experiment: its forces are cut, or the controller keeps it.
enum class BetweenRuns : std::uint8_t { release, hold };
template <>
inline constexpr std::array kWords<BetweenRuns> = {"release", "hold"};

/// Properties of a back end; an unsuitable experiment is refused before it starts.
struct StageInfo {
  std::string name;
  std::string backend;  ///< "sim", "can", "modbus", "replay"
  double sample_rate_hz = 0.0;
  double maximum_rate_hz = 0.0;
  /// From the computed command to the changed output: u[n] is held from t_n + delay_s on.
  double delay_s = 0.0;
  Clock clock = Clock::virtual_time;
  double pace = 1.0;       ///< stage seconds per second of its clock; not 1 only in simulations
  bool stamps = false;     ///< Inputs have t_arrival_ns and stamp_ns
  bool sets_pace = false;  ///< wall clock: the stage samples by its own clock, not by the host's
  std::vector<Channel> actuators;
  std::vector<Channel> sensors;
};

/// Result of an exchange. `ok`, `late` and `bus_passive` have valid measurements.
enum class Outcome : std::uint8_t {
  ok,
  late,         ///< the deadline passed; measurement valid, marked
  incomplete,   ///< some sensors missing: see Inputs::valid
  stale,        ///< nothing new: the last measurement is held
  corrupt,      ///< a frame or reply failed its check
  bus_passive,  ///< the controller is error-passive; measurement valid, marked
  bus_off,
  link_down,
  fault,    ///< the stage reports a fault (interlock, amplifier, non-finite sensor)
  limit,    ///< a limit is or would have been exceeded: see LimitedStage::violation()
  braking,  ///< the loop is unsound and open: the stage brakes by itself; continue exchanging
  opened    ///< the loop is open and the forces must be cut: call stop()
};
template <>
inline constexpr std::array kWords<Outcome> = {"ok",      "late",        "incomplete", "stale",
                                               "corrupt", "bus passive", "bus off",    "link down",
                                               "fault",   "limit",       "braking",    "opened"};

const char* to_string(Outcome outcome) noexcept;

/// Whether the stage or its link has failed.
constexpr bool ends_run(Outcome outcome) noexcept {
  return outcome == Outcome::fault || outcome == Outcome::bus_off || outcome == Outcome::link_down;
}

/// States based on CiA 402.
enum class NodeState : std::uint8_t {
  not_ready,
  switch_on_disabled,
  ready,
  switched_on,
  operation_enabled,
  measuring,
  quick_stop,
  fault_reaction,
  fault
};
template <>
inline constexpr std::array kWords<NodeState> = {"not ready",   "switch on disabled", "ready",
                                                 "switched on", "operation enabled",  "measuring",
                                                 "quick stop",  "fault reaction",     "fault"};

const char* to_string(NodeState state) noexcept;

/// The lowest `count` bits, e.g. Inputs::valid of as many sensors that are all valid.
constexpr std::uint64_t all_bits(std::size_t count) noexcept {
  return count == 0 ? 0 : ~std::uint64_t{0} >> (64 - std::min<std::size_t>(count, 64));
}

/// A measurement. `y` is filled in place (size sensors, SI); `valid` bit i = sensor i.
struct Inputs {
  std::uint64_t cycle = 0;
  std::int64_t t_sample_ns = 0;
  std::int64_t t_rx_ns = 0;
  std::span<double> y;
  std::uint64_t valid = 0;
  NodeState node_state = NodeState::not_ready;
  /// Start of the wait for t_sample, CLOCK_MONOTONIC; 0: unknown. Execution time ends here.
  std::int64_t t_ready_ns = 0;
  /// Arrival of the measurement on the clock of t_sample; 0: unknown.
  std::int64_t t_arrival_ns = 0;
  /// Instant of the measurement by a clock of any offset and drift: of the stage, else of the host; 0: unknown.
  std::int64_t stamp_ns = 0;
  bool stamp_of_stage = false;
  /// Applied commands if they differ from Outputs::u, valid until the next exchange; otherwise empty.
  std::span<const double> applied;
};

/// Commands to the stage. `u`: size actuators, SI.
struct Outputs {
  std::uint64_t cycle = 0;
  std::span<const double> u;
};

/// Absolute time on the stage's clock by which an exchange must have ended; 0: none.
struct Deadline {
  std::int64_t t_ns = 0;
};

/// Interface with one exchange per sample: simulator, replay, CAN FD streaming, Modbus.
///
/// The constructors, prepare() and start() may allocate, block and throw. Between start() and
/// stop() only exchange() is called, from one thread; it does not allocate, lock, log or throw.
///
/// Order: start() leaves the stage at a standstill ready for closed loop and returns the first measurement
/// y[0]. exchange() with u[n], computed from y[n], waits for the next sample instant and returns y[n+1].
class CyclicStage {
 public:
  virtual ~CyclicStage() = default;
  virtual const StageInfo& info() const noexcept = 0;

  /// Brings the stage to operation_enabled and reads y[0] into `first.y`. `run_seed` makes the run
  /// reproducible on back ends that draw random numbers, independently of previous runs; others ignore it.
  /// @throws StageError if the machine does not answer or refuses.
  virtual void start(std::uint64_t run_seed, Inputs& first) = 0;

  [[nodiscard]] virtual Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                         Deadline deadline) noexcept = 0;

  /// Brings the outputs to a safe state (zero force, disabled). Idempotent.
  virtual void stop() noexcept = 0;

  /// Describes problems of the last run in one line, in addition to its Outcome; may be empty.
  virtual std::string trouble() const { return {}; }
};

}  // namespace stageid
