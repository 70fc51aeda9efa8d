#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "excitation/words/words.hpp"
#include "frf/periods/health_finding.hpp"

namespace stageid {

enum class Rounding : std::uint8_t { nearest, down, to_zero, limited };
template <>
inline constexpr std::array kWords<Rounding> = {"rounded to the nearest", "rounded down",
                                                "rounded towards zero", "limited"};

/// An actuator that applies the commands of the log in steps, or only up to a limit, because a coarse converter or a
/// saturated amplifier stands behind the recorder.
struct ActuatorStep {
  Eigen::Index actuator = 0;  ///< index in the log
  double step = 0.0;          ///< in the actuator's unit; the limit, if limited
  Rounding rounding = Rounding::nearest;

  /// What is applied for a command.
  double applied(double command) const noexcept;
};

/// One finding per step, which names its actuators.
std::vector<Finding> to_findings(const std::vector<ActuatorStep>& steps,
                                 const ChannelList& actuators);

}  // namespace stageid
