#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "tests/support/logs/memory_log.hpp"
#include "tests/support/stages/simulated_spec.hpp"

/// Logs of random stages with planted faults. The loop is closed here, sample by sample, around the modal plant and
/// motion controller of hal, so that faults can be inside or outside the recording.
namespace stageid::test {

ChannelList list_of(const std::vector<Channel>& channels);

/// One fault. Channels count within sensors or actuators.
struct PlantedFault {
  enum class Kind : std::uint8_t {
    none,
    // in the recording: the loop runs on the true signals
    recorded_swap,
    recorded_gain,
    recorded_skew,
    mapped_excitation,  ///< an actuator's record is the excitation, before the sum
    lost_samples,       ///< `value` rows of run `a` are not recorded, from row `b` on
    late_excitation,    ///< recorded `value` samples late
    // at the stage: the loop runs with them
    wired_swap,
    wired_gain,
    wired_skew,    ///< a sensor samples, an actuator acts, `value` seconds late
    dead_sensor,   ///< measures its noise
    stuck_sensor,  ///< shows one value from the middle of every run on
    saturation,    ///< |channel| <= value; an actuator's force is limited with it
    drifting_mode,  ///< the frequency of mode `a` moves by the share `value`, evenly over the measurement
    hidden_excitation  ///< an actuator gets `value` N rms more, on the excited lines, unrecorded
  };
  Kind kind = Kind::none;
  bool of_sensor = true;
  int a = 0;
  int b = 0;
  double value = 0.0;
};

struct FaultyLogRequest {
  SimulatedSpec stage;       ///< the true one
  SimulatedSpec configured;  ///< the loop is closed by its controller
  int axes = 13;             ///< the first actuators, one an experiment
  double period_s = 1.0;
  int transient_periods = 1;
  int periods = 3;
  int realizations = 1;
  double level_n = 2.0;  ///< rms
  std::uint64_t seed = 1;
};

/// Masses 3 % off the nominal ones, positions up to 4 mm, first mode 150 to 220 Hz, other damping, suspension
/// and delay, noise 0.3 to 3 nm.
SimulatedSpec random_wafer_stage(std::uint64_t seed, const SimulatedSpec& nominal);

/// @returns a log without runs if the loop did not stay in its sensors' windows: no measurement then.
MemoryLog simulate_faulty_log(const FaultyLogRequest& request, const PlantedFault& fault);

/// x(t - delay), by a windowed sinc; delay in samples.
Eigen::VectorXd delayed(const Eigen::VectorXd& x, double delay);

/// Spoils the recorded signals of a good log: recorded_swap, recorded_gain, recorded_skew, lost_samples (the last rows
/// are those of the period before), late_excitation, and saturation
/// of a sensor that only the recorder has.
void spoil_recording(const PlantedFault& fault, MemoryLog& log);

}  // namespace stageid::test
