#pragma once

#include <cstdint>
#include <vector>

#include "hal/simulator/simulated_stage.hpp"

namespace stageid::test {

// Open loop, one stage with accessible commands and measurements.
class Bench {
 public:
  explicit Bench(const WaferStageSpec& spec)
      : stage_(spec), u(spec.info.actuators.size()), y(spec.info.sensors.size()) {
    inputs.y = y;
  }
  void start(std::uint64_t run_seed = 1) { stage_.start(run_seed, inputs); }
  Outcome step(Deadline deadline = {}) {
    Outputs outputs;
    outputs.cycle = inputs.cycle;
    outputs.u = u;
    return stage_.exchange(outputs, inputs, deadline);
  }

 private:
  SimulatedStage stage_;

 public:
  std::vector<double> u;
  std::vector<double> y;
  Inputs inputs;
  SimulatedStage& stage() { return stage_; }
};

}  // namespace stageid::test
