#include "hal/fault_script.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

namespace stageid {

FaultScript::FaultScript(std::vector<WaferStageSpec::Fault> faults, std::size_t actuators,
                         std::size_t sensors)
    : faults_(std::move(faults)) {
  for (std::size_t i = 0; i < faults_.size(); ++i) {
    const Fault& fault = faults_[i];
    const bool of_sensor = fault.kind == Fault::Kind::dead_sensor ||
                           fault.kind == Fault::Kind::nan_sensor ||
                           fault.kind == Fault::Kind::stuck_sensor;
    const bool of_actuator = fault.kind == Fault::Kind::stuck_actuator;
    const std::size_t channels = of_sensor ? sensors : actuators;
    if ((of_sensor || of_actuator) && !std::in_range<std::size_t>(fault.channel)) {
      throw std::invalid_argument(
          fmt::format("faults: entry {}: channel {} is negative", i + 1, fault.channel));
    }
    if ((of_sensor || of_actuator) && static_cast<std::size_t>(fault.channel) >= channels) {
      throw std::invalid_argument(fmt::format("faults: entry {}: channel {}, but there are {} {}",
                                              i + 1, fault.channel, channels,
                                              of_sensor ? "sensors" : "actuators"));
    }
    if (fault.kind == Fault::Kind::missed_cycle && fault.cycles == 0) {
      throw std::invalid_argument(
          fmt::format("faults: entry {}: a missed_cycle needs cycles of at least 1", i + 1));
    }
  }
}

void FaultScript::start_run(int run) noexcept { run_ = run; }

bool FaultScript::active(const Fault& fault, std::uint64_t cycle) const noexcept {
  if (fault.run >= 0 && fault.run != run_) return false;
  if (cycle < fault.from_cycle) return false;
  return fault.kind != Fault::Kind::missed_cycle || cycle - fault.from_cycle < fault.cycles;
}

bool FaultScript::any(Fault::Kind kind, std::uint64_t cycle) const noexcept {
  return std::any_of(faults_.begin(), faults_.end(), [&](const Fault& fault) {
    return fault.kind == kind && active(fault, cycle);
  });
}

bool FaultScript::missed(std::uint64_t cycle) const noexcept {
  return any(Fault::Kind::missed_cycle, cycle);
}

bool FaultScript::interlock(std::uint64_t cycle) const noexcept {
  return any(Fault::Kind::interlock, cycle);
}

void FaultScript::stick(std::uint64_t cycle, std::span<const double> applied,
                        std::span<double> u) const noexcept {
  for (const Fault& fault : faults_) {
    const auto channel = static_cast<std::size_t>(fault.channel);
    if (fault.kind == Fault::Kind::stuck_actuator && active(fault, cycle))
      u[channel] = applied[channel];
  }
}

std::uint64_t FaultScript::spoil(std::uint64_t cycle, std::span<double> fresh,
                                 std::span<const double> last) const noexcept {
  std::uint64_t missing = 0;
  for (const Fault& fault : faults_) {
    if (!active(fault, cycle)) continue;
    const auto channel = static_cast<std::size_t>(fault.channel);
    if (fault.kind == Fault::Kind::dead_sensor) {
      fresh[channel] = last[channel];
      missing |= std::uint64_t{1} << channel;
    } else if (fault.kind == Fault::Kind::stuck_sensor) {
      fresh[channel] = last[channel];
    } else if (fault.kind == Fault::Kind::nan_sensor) {
      fresh[channel] = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return missing;
}

}  // namespace stageid
