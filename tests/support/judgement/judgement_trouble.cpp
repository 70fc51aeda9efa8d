#include "tests/support/judgement/judgement_trouble.hpp"

#include <cmath>
#include <numbers>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {
namespace {

/// The force on the heave that goes with its motion at the crossover: what keeps the loop stable.
double loop_force(const JudgementStage& stage) {
  const double omega = 2.0 * std::numbers::pi * stage.spec.controller.axes[2].crossover_hz;
  return stage.spec.plant.mass_kg * omega * omega * stage.motion_m;
}

void draw_late_channel(RandomNumbers& random, const JudgementStage& stage, TroublePlan& plan) {
  plan.late_sensor = random.uniform() < 0.5;
  const auto& channels = plan.late_sensor ? stage.spec.info.sensors : stage.spec.info.actuators;
  plan.late = random.integer(0, static_cast<int>(channels.size()) - 1);
  const bool whole = random.uniform() < 0.5;
  plan.late_samples = whole ? random.integer(1, 3) : random.uniform(0.1, 0.9);
  plan.variant =
      std::string(plan.late_sensor ? "sensor" : "actuator") + (whole ? ", whole" : ", part");
  plan.right_causes = {"skew", "late", "delay"};
}

void draw_changed_run(RandomNumbers& random, const JudgementStage& stage, TroublePlan& plan) {
  const int runs = static_cast<int>(stage.plan().runs().size());
  const int fitted = runs * (stage.realizations - 1) / stage.realizations;
  plan.changed_from = random.integer(0, fitted - 1);
  const bool one = random.uniform() < 0.5;
  plan.changed_to = one ? plan.changed_from + 1 : fitted;
  const bool gain = random.uniform() < 0.5;
  if (gain) {
    const int actuators = static_cast<int>(stage.spec.info.actuators.size());
    plan.changed_actuator = random.integer(0, actuators - 1);
    plan.changed_gain = 1.0 + random.uniform(0.05, 0.3);
  } else {
    plan.changed_modes = random.uniform(0.003, 0.03);
  }
  plan.variant = std::string(gain ? "gain" : "modes") + (one ? ", one run" : ", from one run on");
  plan.right_causes = {"drift",  "changed",    "changes", "realizations", "scale",
                       "differ", "controller", "dead",    "rigid_body"};
}

void draw_wrong_map(RandomNumbers& random, JudgementStage& stage, TroublePlan& plan) {
  const bool swapped = random.uniform() < 0.5;
  if (swapped) {
    const int sensors = static_cast<int>(stage.spec.info.sensors.size());
    plan.swapped[0] = random.integer(0, sensors - 1);
    plan.swapped[1] = (plan.swapped[0] + random.integer(1, sensors - 1)) % sensors;
    plan.right_causes = {"swapped", "rigid_body", "controller"};
  } else {
    plan.excitation_as_actuators = true;
    plan.right_causes = {"injection", "inputs", "excitation", "controller", "swapped", "map"};
  }
  plan.variant =
      std::string(swapped ? "sensors" : "excitation") + (stage.stage_file ? ", stage file" : "");
}

}  // namespace

TroublePlan draw_trouble(Trouble trouble, JudgementStage& stage) {
  RandomNumbers random(stage.seed * 0x9e37ULL + 101 * static_cast<std::uint64_t>(trouble) + 3);
  TroublePlan plan;
  plan.trouble = trouble;
  const std::vector<std::string> distortion = {"distort", "nonlinear",   "linearity",  "resolution",
                                               "quantiz", "limit_cycle", "oscillates", "in steps"};
  const double share = std::exp(random.uniform(std::log(0.03), std::log(0.3)));
  switch (trouble) {
    case Trouble::clean:
      break;
    case Trouble::dac_step:
      plan.actuator_quantum_n = share * stage.level_n;
      plan.right_causes = distortion;
      break;
    case Trouble::saturation:
      plan.actuator_limit_n =
          stage.level_n * std::exp(random.uniform(std::log(1.2), std::log(3.0)));
      plan.right_causes = {"saturated", "limit", "distort", "nonlinear"};
      break;
    case Trouble::adc_step:
      plan.sensor_quantum_m = stage.spec.simulation.sensor_noise_m * random.uniform(2.0, 20.0);
      plan.right_causes = distortion;
      break;
    case Trouble::cubic:
      plan.cubic_n_m3 = share * loop_force(stage) / std::pow(stage.motion_m, 3);
      plan.right_causes = distortion;
      break;
    case Trouble::friction:
      plan.friction_n = share * loop_force(stage);
      plan.friction_stiffness_n_m = plan.friction_n / (0.5 * stage.motion_m);
      plan.right_causes = distortion;
      plan.right_causes.push_back("friction");
      break;
    case Trouble::slow_noise:
      stage.noise.colour = NoiseColour::drift;
      stage.noise.density =
          stage.spec.simulation.sensor_noise_m * stage.spec.simulation.sensor_noise_m * 2.0 /
          stage.spec.info.sample_rate_hz * std::pow(10.0, random.uniform(0.5, 2.5));
      stage.noise.reference_hz = 0.2 * stage.band_high_hz;
      plan.right_causes = {"unsettled", "drift", "slow", "uneven_noise", "noise"};
      break;
    case Trouble::mode_drift: {
      plan.drifting_mode = random.integer(0, stage.modes_in_band - 1);
      const double damping = stage.spec.plant.in_plane_modes[plan.drifting_mode].damping_ratio;
      plan.drift_relative = 2.0 * damping * random.uniform(0.3, 2.0);
      plan.right_causes = {"drift", "realizations", "changed"};
      break;
    }
    case Trouble::lost_sample: {
      const int runs = static_cast<int>(stage.plan().runs().size());
      // Not in a run that is held back.
      plan.lost_run = random.integer(0, runs * (stage.realizations - 1) / stage.realizations - 1);
      plan.lost_at = random.uniform(0.2, 0.8);
      plan.right_causes = {"lost", "skew", "aperiodic", "marked", "dropped"};
      break;
    }
    case Trouble::late_channel:
      draw_late_channel(random, stage, plan);
      break;
    case Trouble::unexcited_axis:
      plan.silent_axis = random.integer(0, static_cast<int>(stage.spec.info.actuators.size()) - 1);
      plan.silent_in_record = random.uniform() < 0.5;
      plan.variant = plan.silent_in_record ? "recorded" : "not recorded";
      plan.right_causes = {"excluded", "excitation", "nothing is excited", "dead",
                           "inputs",   "unrecorded", "controller"};
      break;
    case Trouble::unsettled:
      stage.transient_periods = 0;
      plan.right_causes = {"unsettled", "transient"};
      break;
    case Trouble::late_reference:
      plan.reference_late_samples = random.integer(1, 5);
      plan.right_causes = {"skew", "late", "excitation"};
      break;
    case Trouble::setpoint_motion:
      plan.setpoint_m = stage.motion_m * std::pow(10.0, random.uniform(0.0, 2.0));
      plan.right_causes = {"aperiodic", "incoherent", "setpoint",   "motion",
                           "unsettled", "drift",      "controller", "unrecorded"};
      break;
    case Trouble::wrong_map:
      draw_wrong_map(random, stage, plan);
      break;
    case Trouble::changed_run:
      draw_changed_run(random, stage, plan);
      break;
  }
  return plan;
}

}  // namespace stageid::test
