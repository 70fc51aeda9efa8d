#include "acquisition/loop/excited_actuators.hpp"

#include "acquisition/files/fail.hpp"

namespace stageid {

std::vector<int> excited_actuators(const ExperimentSpec& experiment, const StageInfo& stage) {
  std::vector<int> indices;
  for (const ExcitationAxis& axis : experiment.axes) {
    const int index = channel_index(stage.actuators, axis.channel);
    if (index < 0)
      fail_request("axes: unknown actuator '{}'; use an actuator of stage '{}'", axis.channel,
                   stage.name);
    indices.push_back(index);
  }
  return indices;
}

}  // namespace stageid
