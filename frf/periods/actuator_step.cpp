#include "frf/periods/actuator_step.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace stageid {

double ActuatorStep::applied(double command) const noexcept {
  const double steps = command / step;
  switch (rounding) {
    case Rounding::nearest:
      return step * std::round(steps);
    case Rounding::down:
      return step * std::floor(steps);
    case Rounding::to_zero:
      return step * std::trunc(steps);
    case Rounding::limited:
      return std::clamp(command, -step, step);
  }
  return command;
}

std::vector<Finding> to_findings(const std::vector<ActuatorStep>& steps,
                                 const ChannelList& actuators) {
  std::vector<Finding> findings;
  for (const ActuatorStep& s : steps) {
    const std::string& name = actuators.name(s.actuator);
    const std::string figure =
        fmt::format("{:.4g} {}, {}", s.step, actuators.unit(s.actuator), to_string(s.rounding));
    const auto same = std::ranges::find(findings, figure, &Finding::figure);
    if (same != findings.end()) {
      same->channel += " " + name;
      continue;
    }
    const bool limited = s.rounding == Rounding::limited;
    findings.push_back(
        {Severity::doubt, limited ? Cause::saturated : Cause::actuator_step, name,
         limited ? "applies its command up to a limit only, as a saturated amplifier does; the "
                   "response is that to what it applied, not to the recorded command"
                 : "applies its command in steps, as a coarse converter does; the response is that "
                   "to the steps, not to the recorded command",
         figure,
         limited ? "lower the level, or raise the actuator's limit"
                 : "use a finer converter, or record what it applies"});
  }
  return findings;
}

}  // namespace stageid
