#pragma once

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"
#include "tests/support/judgement/judgement_stage.hpp"
#include "tests/support/logs/memory_log.hpp"
#include "tests/support/stages/dahl_friction.hpp"

namespace stageid::test {

enum class Trouble : std::uint8_t {
  clean,
  dac_step,
  adc_step,
  cubic,
  friction,
  slow_noise,
  mode_drift,
  lost_sample,
  late_channel,
  unexcited_axis,
  unsettled,
  late_reference,  ///< the excitation is recorded late
  setpoint_motion,
  wrong_map,
  changed_run,  ///< the stage differs in one run, or from one run on
  saturation    ///< the amplifiers limit the force below the recorded commands
};
}  // namespace stageid::test

namespace stageid {
template <>
inline constexpr std::array kWords<test::Trouble> = {
    "clean",           "dac_step",       "adc_step",    "cubic",
    "friction",        "slow_noise",     "mode_drift",  "lost_sample",
    "late_channel",    "unexcited_axis", "unsettled",   "late_reference",
    "setpoint_motion", "wrong_map",      "changed_run", "saturation"};
}

namespace stageid::test {

/// The trouble planted in one measurement; drawn by draw_trouble().
struct TroublePlan {
  Trouble trouble = Trouble::clean;
  std::string variant;  ///< empty: there is one kind only
  /// Accepted answers of the program: causes of findings, or parts of the sentence of a verdict.
  std::vector<std::string> right_causes;
  // at the stage
  double actuator_quantum_n = 0.0;
  double actuator_limit_n = 0.0;  ///< 0: none
  double sensor_quantum_m = 0.0;
  double cubic_n_m3 = 0.0;  ///< on the rigid heave
  double friction_n = 0.0;
  double friction_stiffness_n_m = 0.0;
  int drifting_mode = -1;       ///< of JudgementStage::spec.plant.in_plane_modes
  double drift_relative = 0.0;  ///< of its frequency, from the first to the last sample of all runs
  double setpoint_m = 0.0;      ///< rms size of slow motion in heave
  int silent_axis = -1;         ///< its excitation does not arrive
  int changed_from = -1;        ///< first run of the changed stage
  int changed_to = -1;          ///< the run after the last of it
  double changed_gain = 1.0;    ///< of one actuator
  int changed_actuator = -1;
  double changed_modes = 0.0;  ///< relative change of all frequencies of the flexible modes
  // in the recording
  int lost_run = -1;
  double lost_at = 0.0;  ///< share of the measured periods
  bool late_sensor = false;
  int late = -1;  ///< channel
  double late_samples = 0.0;
  int reference_late_samples = 0;
  int swapped[2] = {-1, -1};  ///< sensors
  bool excitation_as_actuators = false;
  bool silent_in_record = false;  ///< the record contains that the silent axis was not excited
};

/// May change the stage: the strength of its noise, its transient periods.
TroublePlan draw_trouble(Trouble trouble, JudgementStage& stage);

struct LoopRanAway : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Measures the stage with its trouble, in virtual time, as `stageid run` would, in the layout of a foreign log.
/// @throws LoopRanAway
MemoryLog measure_with_trouble(const JudgementStage& stage, const TroublePlan& plan);

/// The best linear approximation of the plant with its trouble: the mean over 20 noise-free realizations of the same
/// excitation with other phases (Pintelon and Schoukens, System Identification, section 3.4).
/// @returns (sensors x actuators) x lines of stage.plan().grid()
/// @throws LoopRanAway
Eigen::MatrixXcd best_linear_approximation(const JudgementStage& stage, const TroublePlan& plan);

}  // namespace stageid::test
