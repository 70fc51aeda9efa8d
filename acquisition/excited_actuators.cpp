#include "acquisition/excited_actuators.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace stageid {

std::vector<int> excited_actuators(const ExperimentPlan& plan, const StageInfo& stage) {
  std::vector<int> indices;
  for (const ExcitationAxis& axis : plan.spec().axes) {
    const auto found = std::find_if(stage.actuators.begin(), stage.actuators.end(),
                                    [&](const Channel& c) { return c.name == axis.channel; });
    if (found == stage.actuators.end())
      throw std::invalid_argument(fmt::format(
          "experiment: axis '{}' is no actuator of the stage '{}'", axis.channel, stage.name));
    indices.push_back(static_cast<int>(found - stage.actuators.begin()));
  }
  return indices;
}

}  // namespace stageid
