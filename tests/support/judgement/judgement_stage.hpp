#pragma once

#include <cstdint>
#include <string>

#include "excitation/plan/experiment_plan.hpp"
#include "tests/support/stages/coloured_noise.hpp"
#include "tests/support/stages/simulated_spec.hpp"

/// Random stages for judgement_study: everything that a measurement needs, drawn from one seed.
namespace stageid::test {

struct JudgementStage {
  std::uint64_t seed = 0;
  /// The true plant, its limits unused, and the controller that closes the loop. Modes in the band and one or two
  /// above it are `in_plane_modes`, whose shapes reach all channels.
  SimulatedSpec spec;
  ColouredNoiseSpec
      noise;            ///< of the sensors, in addition to the white spec.simulation.sensor_noise_m
  double snr_db = 0.0;  ///< median magnitude of the response over the noise of its mean
  double level_n = 1.0;   ///< rms per axis
  double motion_m = 0.0;  ///< rms of the rigid heave under excitation
  int period_samples = 0;
  double band_low_hz = 0.0;
  double band_high_hz = 0.0;
  int modes_in_band = 0;
  int transient_periods = 1;  ///< until a disturbance has decayed to 1e-5
  int periods = 3;
  int realizations = 3;  ///< the last one is held back
  ExcitationScheme scheme = ExcitationScheme::single_axis;
  bool stage_file = false;  ///< the program is given nominal_text()

  ExperimentPlan plan() const;
  /// A stage file with names, geometry, controller and nominal rigid body (mass and inertia up to 2 % off), without
  /// flexible modes.
  std::string nominal_text() const;
  std::string description() const;
};

/// Sizes 2 x 2 to 7 x 17. The loop is stable: a kick decays. Peaks of all modes in the band are at least 20 dB above
/// the noise of the response in their best channel.
JudgementStage draw_judgement_stage(std::uint64_t seed);

}  // namespace stageid::test
