#include "hal/simulator/fault_script.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/simulator/rigid_body.hpp"

namespace stageid {
namespace {

using Fault = SimulationSpec::Fault;
using Kind = Fault::Kind;

constexpr double kLongestExtraDelay = 1000.0;  // samples

// In the order of Kind.
constexpr FaultTraits kTraits[] = {
    {FaultTarget::stage, false, false},     // none
    {FaultTarget::sensor, false, false},    // dead_sensor
    {FaultTarget::sensor, false, false},    // nan_sensor
    {FaultTarget::stage, false, false},     // missed_cycle
    {FaultTarget::stage, false, false},     // interlock
    {FaultTarget::actuator, false, false},  // stuck_actuator
    {FaultTarget::sensor, false, false},    // stuck_sensor
    {FaultTarget::sensor, true, true},      // sensor_offset
    {FaultTarget::sensor, true, false},     // sensor_drift
    {FaultTarget::actuator, true, true},    // actuator_gain
    {FaultTarget::stage, false, true},      // extra_delay
    {FaultTarget::mode, true, true},        // mode_frequency
    {FaultTarget::mode, true, true},        // mode_damping
    {FaultTarget::sensor, true, true},      // sensor_gain
    {FaultTarget::sensor, true, true},      // sensor_noise
    {FaultTarget::actuator, false, true},   // added_mass
};
static_assert(std::size(kTraits) == kWords<Kind>.size());

FaultTarget target_of(const Fault& fault) { return fault_traits(fault.kind).target; }

bool hits(const Fault& fault, std::size_t channel) {
  if (fault.channel >= 0) return static_cast<std::size_t>(fault.channel) == channel;
  return target_of(fault) != FaultTarget::mode || channel >= kRigidAxes;
}

void check_mode(const Fault& fault, std::size_t number, std::size_t index, const PlantMode& mode) {
  const double factor = 1.0 + fault.value;
  const double hz = factor * mode.natural_frequency_hz;
  require(fault.kind != Kind::mode_frequency || (hz > 0.0 && std::isfinite(hz)),
          "faults: entry {}: the natural frequency of mode {} would be {:.6g} Hz; must be positive",
          number, index, hz);
  const double ratio = factor * mode.damping_ratio;
  require(
      fault.kind != Kind::mode_damping || (ratio > 0.0 && ratio < 1.0),
      "faults: entry {}: the damping ratio of mode {} would be {:.6g}; must be above 0 and below 1",
      number, index, ratio);
}

void check_channel(const Fault& fault, std::size_t number, const StageInfo& info) {
  const FaultTraits traits = fault_traits(fault.kind);
  if (traits.may_be_all && fault.channel == -1) return;
  const bool sensor = traits.target == FaultTarget::sensor;
  const std::size_t channels = sensor ? info.sensors.size() : info.actuators.size();
  require(fault.channel >= 0, "faults: entry {}: channel {} is negative", number, fault.channel);
  require(static_cast<std::size_t>(fault.channel) < channels,
          "faults: entry {}: channel {} is out of range; there are {} {}", number, fault.channel,
          channels, sensor ? "sensors" : "actuators");
}

void check_modes(const Fault& fault, std::size_t number, const std::vector<PlantMode>& modes) {
  const auto last = static_cast<int>(modes.size()) - 1;
  require(
      fault.channel >= -1 && fault.channel <= last,
      "faults: entry {}: mode {} is out of range; allowed: 0 to {}, or -1 for all flexible modes",
      number, fault.channel, last);
  require(fault.channel >= 0 || modes.size() > kRigidAxes,
          "faults: entry {}: the plant has no flexible mode", number);
  for (std::size_t i = 0; i < modes.size(); ++i)
    if (hits(fault, i)) check_mode(fault, number, i, modes[i]);
}

void check(const Fault& fault, std::size_t number, const StageInfo& info,
           const std::vector<PlantMode>& modes) {
  const FaultTraits traits = fault_traits(fault.kind);
  if (traits.target == FaultTarget::mode) {
    check_modes(fault, number, modes);
  } else if (traits.target != FaultTarget::stage) {
    check_channel(fault, number, info);
  }
  require(fault.kind != Kind::missed_cycle || fault.cycles > 0,
          "faults: entry {}: missed_cycle needs cycles of at least 1", number);
  require(std::isfinite(fault.value), "faults: entry {}: the value is not finite", number);
  require(
      fault.kind != Kind::extra_delay || (fault.value >= 1.0 && fault.value <= kLongestExtraDelay &&
                                          fault.value == std::floor(fault.value)),
      "faults: entry {}: extra_delay is {} samples; allowed: whole numbers 1 to {}", number,
      fault.value, kLongestExtraDelay);
  require(fault.kind != Kind::sensor_noise || fault.value >= 0.0,
          "faults: entry {}: sensor_noise is {}; must be 0 or more", number, fault.value);
  require(fault.ramp_s >= 0.0 && std::isfinite(fault.ramp_s),
          "faults: entry {}: ramp_s is {}; must be 0 or more", number, fault.ramp_s);
  require(fault.ramp_s == 0.0 || traits.may_ramp,
          "faults: entry {}: {} cannot be gradual; remove ramp_s", number, to_string(fault.kind));
}

/// Faults of one mode multiply. In every run, all of them together must leave it oscillating.
void check_together(const std::vector<Fault>& faults, const std::vector<PlantMode>& modes) {
  for (const Fault& one : faults)
    for (std::size_t i = 0; i < modes.size(); ++i) {
      if (one.kind != Kind::mode_damping || !hits(one, i)) continue;
      double ratio = modes[i].damping_ratio;
      for (const Fault& other : faults)
        if (other.kind == one.kind && hits(other, i) && (other.run < 0 || other.run == one.run))
          ratio *= std::max(1.0, 1.0 + other.value);
      require(ratio < 1.0,
              "faults: the entries together raise the damping ratio of mode {} to {:.6g}; must be "
              "below 1",
              i, ratio);
    }
}

}  // namespace

FaultTraits fault_traits(Kind kind) noexcept { return kTraits[static_cast<std::size_t>(kind)]; }

FaultScript::FaultScript(std::vector<SimulationSpec::Fault> faults, const StageInfo& info,
                         const std::vector<PlantMode>& modes)
    : faults_(std::move(faults)), period_s_(1.0 / info.sample_rate_hz) {
  for (std::size_t i = 0; i < faults_.size(); ++i) {
    check(faults_[i], i + 1, info, modes);
    if (target_of(faults_[i]) == FaultTarget::mode && modes_.empty())
      for (const PlantMode& mode : modes)
        modes_.push_back({mode.natural_frequency_hz, mode.damping_ratio});
    if (faults_[i].kind == Kind::added_mass) load(faults_[i], info, modes);
    if (faults_[i].kind == Kind::extra_delay)
      history_cycles_ = std::max(history_cycles_, static_cast<std::size_t>(faults_[i].value) + 1);
  }
  check_together(faults_, modes);
  history_.assign(history_cycles_ * info.actuators.size(), 0.0);
  tuned_ = modes_;
}

void FaultScript::load(const Fault& fault, const StageInfo& info,
                       const std::vector<PlantMode>& modes) {
  require(loaded_.empty(), "faults: only one entry may be added_mass; add the masses up");
  const Eigen::Index actuator = fault.channel;
  Eigen::VectorXd shape(std::ssize(modes));
  for (Eigen::Index i = 0; i < shape.size(); ++i) {
    const PlantMode& mode = modes[static_cast<std::size_t>(i)];
    require(mode.natural_frequency_hz > 0.0,
            "faults: added_mass needs natural frequencies above 0, but mode {} has 0 Hz; set "
            "suspension_hz",
            i);
    shape[i] =
        mode.actuator_shape[actuator] / info.actuators[static_cast<std::size_t>(actuator)].gain;
  }
  require(1.0 + fault.value * shape.squaredNorm() > 0.0,
          "faults: added_mass is {} kg; must be above {:.6g} kg, which is all that moves there",
          fault.value, -1.0 / shape.squaredNorm());
  const int steps = fault.ramp_s > 0.0 ? kMassSteps : 1;
  for (int step = 0; step <= steps; ++step)
    loaded_.push_back(loaded_modes(modes, shape, fault.value * step / steps));
  // Without the mass, the modes are those given, not only up to rounding.
  const Eigen::Index n = std::ssize(modes);
  loaded_.front() = {modes, Eigen::MatrixXd::Identity(n, n), Eigen::MatrixXd::Identity(n, n)};
}

void FaultScript::carry(std::uint64_t cycle, ModalPlant& plant) noexcept {
  std::size_t wanted = 0;
  for (const Fault& fault : faults_)
    if (fault.kind == Kind::added_mass && active(fault, cycle))
      wanted = static_cast<std::size_t>(
          std::lround(growth(fault, cycle) * static_cast<double>(loaded_.size() - 1)));
  if (wanted == load_) return;
  plant.reload(loaded_[load_], loaded_[wanted]);
  load_ = wanted;
  for (std::size_t i = 0; i < modes_.size(); ++i) {
    const PlantMode& mode = loaded_[load_].modes[i];
    modes_[i] = {mode.natural_frequency_hz, mode.damping_ratio};
  }
  tuned_ = modes_;
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

// The part of the full change that is reached.
double FaultScript::growth(const Fault& fault, std::uint64_t cycle) const noexcept {
  if (fault.ramp_s == 0.0) return 1.0;
  const double instant = target_of(fault) == FaultTarget::sensor ? 1.0 : 0.5;
  const double since_s = (static_cast<double>(cycle - fault.from_cycle) + instant) * period_s_;
  return std::min(1.0, since_s / fault.ramp_s);
}

double FaultScript::factor(const Fault& fault, std::uint64_t cycle) const noexcept {
  const double full = target_of(fault) == FaultTarget::mode ? 1.0 + fault.value : fault.value;
  return std::lerp(1.0, full, growth(fault, cycle));
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
    if (target_of(fault) != FaultTarget::actuator || fault.kind == Kind::added_mass ||
        !active(fault, cycle))
      continue;
    for (std::size_t i = 0; i < u.size(); ++i)
      if (hits(fault, i))
        u[i] = fault.kind == Kind::stuck_actuator ? applied[i] : factor(fault, cycle) * u[i];
  }
}

void FaultScript::retune(std::uint64_t cycle, ModalPlant& plant) noexcept {
  if (!loaded_.empty()) carry(cycle, plant);
  for (std::size_t i = 0; i < modes_.size(); ++i) {
    Mode mode = modes_[i];
    for (const Fault& fault : faults_) {
      if (target_of(fault) != FaultTarget::mode || !hits(fault, i) || !active(fault, cycle))
        continue;
      (fault.kind == Kind::mode_frequency ? mode.natural_frequency_hz : mode.damping_ratio) *=
          factor(fault, cycle);
    }
    if (mode == tuned_[i]) continue;
    tuned_[i] = mode;
    plant.retune(static_cast<Eigen::Index>(i), mode.natural_frequency_hz, mode.damping_ratio);
  }
}

void FaultScript::amplify(std::uint64_t cycle, std::span<double> noise) const noexcept {
  for (const Fault& fault : faults_) {
    if (fault.kind != Kind::sensor_noise || !active(fault, cycle)) continue;
    for (std::size_t i = 0; i < noise.size(); ++i)
      if (hits(fault, i)) noise[i] *= factor(fault, cycle);
  }
}

void FaultScript::delay(std::uint64_t cycle, std::span<double> u) noexcept {
  const auto slot = [&](std::uint64_t n) {
    return history_.begin() + (n % history_cycles_) * u.size();
  };
  std::copy(u.begin(), u.end(), slot(cycle));
  std::uint64_t samples = 0;
  for (const Fault& fault : faults_)
    if (fault.kind == Kind::extra_delay && active(fault, cycle))
      samples = std::max(samples, static_cast<std::uint64_t>(growth(fault, cycle) * fault.value));
  if (samples == 0 || samples > cycle) return;
  const auto from = slot(cycle - samples);
  std::copy(from, from + static_cast<std::ptrdiff_t>(u.size()), u.begin());
}

std::uint64_t FaultScript::spoil(std::uint64_t cycle, std::span<double> fresh,
                                 std::span<const double> last) const noexcept {
  std::uint64_t missing = 0;
  for (const Fault& fault : faults_) {
    if (!active(fault, cycle)) continue;
    if (fault.kind == Kind::sensor_offset || fault.kind == Kind::sensor_drift) {
      const double since_s = static_cast<double>(cycle + 1 - fault.from_cycle) * period_s_;
      const double scale = fault.kind == Kind::sensor_drift ? since_s : growth(fault, cycle);
      for (std::size_t i = 0; i < fresh.size(); ++i)
        if (hits(fault, i)) fresh[i] += scale * fault.value;
    } else if (fault.kind == Kind::sensor_gain) {
      for (std::size_t i = 0; i < fresh.size(); ++i)
        if (hits(fault, i)) fresh[i] *= factor(fault, cycle);
    } else if (fault.kind == Fault::Kind::dead_sensor) {
      fresh[fault.channel] = last[fault.channel];
      missing |= std::uint64_t{1} << fault.channel;
    } else if (fault.kind == Fault::Kind::stuck_sensor) {
      fresh[fault.channel] = last[fault.channel];
    } else if (fault.kind == Fault::Kind::nan_sensor) {
      fresh[fault.channel] = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return missing;
}

}  // namespace stageid
