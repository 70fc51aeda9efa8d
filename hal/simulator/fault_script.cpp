#include "hal/simulator/fault_script.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hal/stage/require.hpp"

namespace stageid {
namespace {

using Fault = SimulationSpec::Fault;
using Kind = Fault::Kind;

constexpr double kLongestExtraDelay = 1000.0;  // samples

bool of_sensor(Kind kind) {
  return kind == Kind::dead_sensor || kind == Kind::nan_sensor || kind == Kind::stuck_sensor ||
         kind == Kind::sensor_offset || kind == Kind::sensor_drift;
}
bool of_actuator(Kind kind) { return kind == Kind::stuck_actuator || kind == Kind::actuator_gain; }
bool may_be_all(Kind kind) {
  return kind == Kind::sensor_offset || kind == Kind::sensor_drift || kind == Kind::actuator_gain;
}
bool hits(const Fault& fault, std::size_t channel) {
  return fault.channel < 0 || static_cast<std::size_t>(fault.channel) == channel;
}

void check(const Fault& fault, std::size_t number, const StageInfo& info) {
  const std::size_t channels = of_sensor(fault.kind) ? info.sensors.size() : info.actuators.size();
  const bool all = may_be_all(fault.kind) && fault.channel == -1;
  if ((of_sensor(fault.kind) || of_actuator(fault.kind)) && !all) {
    require(fault.channel >= 0, "faults: entry {}: channel {} is negative", number, fault.channel);
    require(static_cast<std::size_t>(fault.channel) < channels,
            "faults: entry {}: channel {} is out of range; there are {} {}", number, fault.channel,
            channels, of_sensor(fault.kind) ? "sensors" : "actuators");
  }
  require(fault.kind != Kind::missed_cycle || fault.cycles > 0,
          "faults: entry {}: missed_cycle needs cycles of at least 1", number);
  require(std::isfinite(fault.value), "faults: entry {}: the value is not finite", number);
  require(
      fault.kind != Kind::extra_delay || (fault.value >= 1.0 && fault.value <= kLongestExtraDelay &&
                                          fault.value == std::floor(fault.value)),
      "faults: entry {}: extra_delay is {} samples; allowed: whole numbers 1 to {}", number,
      fault.value, kLongestExtraDelay);
}

}  // namespace

FaultScript::FaultScript(std::vector<SimulationSpec::Fault> faults, const StageInfo& info)
    : faults_(std::move(faults)), period_s_(1.0 / info.sample_rate_hz) {
  for (std::size_t i = 0; i < faults_.size(); ++i) {
    check(faults_[i], i + 1, info);
    if (faults_[i].kind == Kind::extra_delay)
      history_cycles_ = std::max(history_cycles_, static_cast<std::size_t>(faults_[i].value) + 1);
  }
  history_.assign(history_cycles_ * info.actuators.size(), 0.0);
}

void FaultScript::start_run(int run) noexcept {
  run_ = run;
  std::fill(history_.begin(), history_.end(), 0.0);
}

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

void FaultScript::drive(std::uint64_t cycle, std::span<const double> applied,
                        std::span<double> u) noexcept {
  if (!history_.empty()) delay(cycle, u);
  for (const Fault& fault : faults_) {
    if (!of_actuator(fault.kind) || !active(fault, cycle)) continue;
    for (std::size_t i = 0; i < u.size(); ++i)
      if (hits(fault, i))
        u[i] = fault.kind == Kind::stuck_actuator ? applied[i] : fault.value * u[i];
  }
}

void FaultScript::delay(std::uint64_t cycle, std::span<double> u) noexcept {
  const auto slot = [&](std::uint64_t n) {
    return history_.begin() + static_cast<std::ptrdiff_t>((n % history_cycles_) * u.size());
  };
  std::copy(u.begin(), u.end(), slot(cycle));
  std::uint64_t samples = 0;
  for (const Fault& fault : faults_)
    if (fault.kind == Kind::extra_delay && active(fault, cycle))
      samples = std::max(samples, static_cast<std::uint64_t>(fault.value));
  if (samples == 0 || samples > cycle) return;
  const auto from = slot(cycle - samples);
  std::copy(from, from + static_cast<std::ptrdiff_t>(u.size()), u.begin());
}

std::uint64_t FaultScript::spoil(std::uint64_t cycle, std::span<double> fresh,
                                 std::span<const double> last) const noexcept {
  std::uint64_t missing = 0;
  for (const Fault& fault : faults_) {
    if (!active(fault, cycle)) continue;
    const auto channel = static_cast<std::size_t>(fault.channel);
    if (fault.kind == Kind::sensor_offset || fault.kind == Kind::sensor_drift) {
      const double since_s = static_cast<double>(cycle + 1 - fault.from_cycle) * period_s_;
      const double scale = fault.kind == Kind::sensor_drift ? since_s : 1.0;
      for (std::size_t i = 0; i < fresh.size(); ++i)
        if (hits(fault, i)) fresh[i] += scale * fault.value;
    } else if (fault.kind == Fault::Kind::dead_sensor) {
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
