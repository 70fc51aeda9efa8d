#pragma once

#include <cstdint>
#include <vector>

#include "hal/stage/stage.hpp"

namespace stageid::test {

/// Records its commands and returns given measurements.
class FakeStage final : public CyclicStage {
 public:
  FakeStage(int actuators, int sensors, double sample_rate_hz) {
    info_.sample_rate_hz = sample_rate_hz;
    info_.actuators.resize(actuators);
    info_.sensors.resize(sensors);
    for (Channel& actuator : info_.actuators) actuator.unit.assign(1, 'N');
    for (Channel& sensor : info_.sensors) sensor.unit.assign(1, 'm');
    for (int i = 0; i < actuators; ++i)
      info_.actuators[i].name.assign(1, static_cast<char>('a' + i));
    for (int i = 0; i < sensors; ++i) info_.sensors[i].name.assign(1, static_cast<char>('s' + i));
    measurement.resize(sensors);
  }

  const StageInfo& info() const noexcept override { return info_; }
  void start(std::uint64_t run_seed, Inputs& first) override {
    seed = run_seed;
    cycle_ = 0;
    give(first);
  }
  Outcome exchange(const Outputs& outputs, Inputs& inputs, Deadline) noexcept override {
    commands.emplace_back(outputs.u.begin(), outputs.u.end());
    ++cycle_;
    give(inputs);
    return outcome;
  }
  void stop() noexcept override { ++stops; }

  std::vector<double> measurement;
  Outcome outcome = Outcome::ok;
  std::vector<std::vector<double>> commands;
  std::uint64_t seed = 0;
  int stops = 0;

 private:
  void give(Inputs& inputs) const {
    for (std::size_t i = 0; i < measurement.size(); ++i) inputs.y[i] = measurement[i];
    inputs.cycle = cycle_;
    inputs.valid = (std::uint64_t{1} << measurement.size()) - 1;
    inputs.node_state = NodeState::operation_enabled;
  }

  StageInfo info_;
  std::uint64_t cycle_ = 0;
};

}  // namespace stageid::test
