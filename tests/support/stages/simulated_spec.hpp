#pragma once

#include <memory>

#include "hal/simulator/simulated_stage.hpp"
#include "hal/stage/stage_spec.hpp"

namespace stageid::test {

/// A stage and all that its simulation needs.
struct SimulatedSpec : StageSpec {
  PlantSpec plant;
  SimulationSpec simulation;
  double pace = 0.0;  ///< see SimulatedStage
};

inline std::unique_ptr<SimulatedStage> simulated(const SimulatedSpec& spec) {
  return std::make_unique<SimulatedStage>(spec.info, spec.plant, spec.simulation, spec.pace);
}

}  // namespace stageid::test
