#pragma once

#include <optional>
#include <string>
#include <vector>

#include "excitation/plan/experiment_plan.hpp"
#include "hal/simulator/plant_spec.hpp"
#include "hal/stage/stage_spec.hpp"

namespace stageid {

/// Predicted signal of one channel, over all runs of a plan, in steady state and without noise.
struct ChannelPrediction {
  std::string name;
  std::string unit;
  double rms = 0.0;          ///< largest over the runs
  double peak = 0.0;         ///< largest absolute sample
  double slew_per_s = 0.0;   ///< actuators: largest change from sample to sample, times the rate
  double thermal_rms = 0.0;  ///< actuators: largest rms over the exponential window of the limit
  std::vector<std::string> violations = {};  ///< one line each; empty: within all limits
};

struct DesignPrediction {
  std::vector<ChannelPrediction> actuators;
  std::vector<ChannelPrediction> sensors;
  std::vector<double> crest_factor;  ///< of the excitation of every axis, largest over the runs
  std::vector<std::string> violations() const;
};

/// Why the signals of a stage cannot be predicted; empty if they can: its plant and its controller are known.
std::string why_unpredictable(const StageSpec& stage, const std::optional<PlantSpec>& plant);

/// Predicts u and y of every run from the exact sampled plant and its controller:
///   u = f + (I - K G)^-1 r,  y = G u,  with feed-forward f and K the response from y to u,
/// line by line, then sample by sample over one period. Only the crest factors if the signals are unpredictable.
/// @throws std::invalid_argument if the plan excites a channel that the stage does not have.
DesignPrediction predict_closed_loop(const ExperimentPlan& plan, const StageSpec& stage,
                                     const std::optional<PlantSpec>& plant);

}  // namespace stageid
