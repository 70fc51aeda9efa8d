#include "acquisition/loop/excited_actuators.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace stageid {

std::vector<int> excited_actuators(const ExperimentSpec& experiment, const StageInfo& stage) {
  std::vector<int> indices;
  for (const ExcitationAxis& axis : experiment.axes) {
    const int index = channel_index(stage.actuators, axis.channel);
    if (index < 0)
      throw std::invalid_argument(fmt::format(
          "axes: unknown actuator '{}'; use an actuator of stage '{}'", axis.channel, stage.name));
    indices.push_back(index);
  }
  return indices;
}

}  // namespace stageid
