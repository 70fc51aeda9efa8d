#include "tools/config/stage_keys.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "hal/can/can_frame.hpp"
#include "hal/simulator/fault_script.hpp"

namespace stageid {
namespace {

void describe_real_time(ConfigVisitor& visitor, RealTimeKeys& keys) {
  choose(visitor, "policy", keys.options.policy, kOptional,
         "try: warn about missing prerequisites; require: exit code 1 without the permissions or a "
         "PREEMPT_RT kernel");
  count(visitor, "priority", keys.options.priority, 1, 99, kOptional, "SCHED_FIFO priority");
  count(visitor, "cpu", keys.options.cpu, -1, 4095, kOptional,
        "processor that the loop is pinned to; -1: not pinned");
  std::size_t lock = keys.options.lock_memory ? 1 : 0;
  visitor.choice("lock_memory", lock, {"false", "true"}, kOptional,
                 "lock the memory so that it is never swapped");
  keys.options.lock_memory = lock == 1;
  visitor.number("jitter_s", keys.jitter_s, not_negative("s"), kOptional,
                 "on the wall clock, samples that are off by more are marked. 0: half a sample, "
                 "and 0.1 rad rms of phase at the highest excited frequency in a run");
  count(visitor, "misses_allowed", keys.misses_allowed, 0, 1'000'000, kOptional,
        "the run is stopped if a counter exceeds this value: +2 per bad cycle, -1 per good one, at "
        "least 0");
}

/// The first unit is the default.
void describe_channel(ConfigVisitor& v, ChannelConfig& c, const std::vector<std::string>& units,
                      const char* gain) {
  std::size_t unit = 0;
  v.text("name", c.channel.name, kRequired, "name used in logs and models");
  v.choice("unit", unit, units, kOptional, "unit of its values in commands, logs and models");
  c.channel.unit = units.at(unit);
  v.number("gain", c.channel.gain, any_number(""), kOptional, gain);
  v.require(c.channel.gain != 0.0, "gain", "gain: must not be zero");
  std::vector<double> position_m = {0.0, 0.0, 0.0};
  std::vector<double> direction = {0.0, 0.0, 1.0};
  v.numbers("position_m", position_m, any_number("m"), {3, 3}, kRequired,
            "x, y, z from the centre of mass");
  v.numbers("direction", direction, any_number(""), {3, 3}, kOptional,
            "unit vector; for a rotation, its axis");
  if (position_m.size() == 3) std::ranges::copy(position_m, c.channel.position_m);
  if (direction.size() == 3) std::ranges::copy(direction, c.channel.direction);
  const auto& d = c.channel.direction;
  const double length = std::hypot(d[0], d[1], d[2]);
  v.require(std::abs(length - 1.0) < 1e-6, "direction",
            fmt::format("direction: the length is {}; write a unit vector", length));
}

/// A number with two keys: one in SI with the unit in its name, and one in the unit of the channel.
struct TwoKeys {
  const char* si_key;
  const char* si_unit;
  const char* key;
};

void describe_number(ConfigVisitor& v, const ChannelConfig& c, double& value, TwoKeys keys,
                     NumberRule rule, const char* help) {
  const double unset = value;
  double neutral = value;
  rule.unit = keys.si_unit;
  v.number(keys.si_key, value, rule, kOptional, help);
  rule.unit = "";
  v.number(keys.key, neutral, rule, kOptional, "the same in the unit of the channel");
  const bool si = value != unset;
  v.require(!si || neutral == unset, keys.key,
            fmt::format("{}: is also given as {}; write one of them", keys.key, keys.si_key));
  const std::string& unit = c.channel.unit;
  v.require(!si || unit == "N" || unit == "m", keys.si_key,
            fmt::format("{}: the unit of this channel is {}; write '{}: NUMBER' in this unit",
                        keys.si_key, unit, keys.key));
  if (!si) value = neutral;
}

/// Adds one channel; a duplicate name is an error.
void add_channel(ConfigVisitor& v, ChannelConfig channel, std::vector<ChannelConfig>& list) {
  const bool twice = std::ranges::any_of(
      list, [&](const ChannelConfig& other) { return other.channel.name == channel.channel.name; });
  v.require(
      !twice, "name",
      fmt::format("duplicate channel name '{}'; channel names must differ", channel.channel.name));
  list.push_back(std::move(channel));
}

void describe_actuator(ConfigVisitor& v, std::vector<ChannelConfig>& list) {
  ChannelConfig c;
  describe_channel(v, c, {"N", "Nm", "A", "V"}, "force in N, or torque in Nm, per unit");
  describe_number(
      v, c, c.limit_n, {"limit_n", "N", "limit"}, positive(""),
      "largest |u|; the stage is stopped if it is exceeded. This key or limit is required");
  v.require(std::isfinite(c.limit_n), "name",
            "key 'limit' is missing; add it (largest |u|, in the unit of the channel)");
  describe_number(v, c, c.slew_n_s, {"slew_n_s", "N/s", "slew"}, positive(""),
                  "largest change of u; inf: no limit");
  describe_number(v, c, c.thermal_rms_n, {"thermal_rms_n", "N", "thermal_rms"}, positive(""),
                  "largest rms of u over the thermal time constant; inf: no limit");
  describe_number(v, c, c.bias_n, {"bias_n", "N", "bias"}, any_number(""),
                  "constant feed-forward, e.g. against gravity; it rises over ramp_s when the loop "
                  "is closed");
  v.require(std::abs(c.bias_n) <= c.limit_n, "bias_n",
            fmt::format("bias_n: {} {} exceeds limit_n: {}; write a smaller value", c.bias_n,
                        c.channel.unit, c.limit_n));
  add_channel(v, std::move(c), list);
}

void describe_sensor(ConfigVisitor& v, std::vector<ChannelConfig>& list) {
  ChannelConfig c;
  describe_channel(v, c, {"m", "rad", "m/s^2", "rad/s^2", "V"},
                   "units per m or rad, or per m/s^2 or rad/s^2");
  describe_number(
      v, c, c.window_m, {"window_m", "m", "window"}, positive(""),
      "largest |y|; the stage is stopped if it is exceeded. This key or window is required");
  v.require(std::isfinite(c.window_m), "name",
            "key 'window' is missing; add it (largest |y|, in the unit of the channel)");
  describe_number(v, c, c.hard_window_m, {"hard_window_m", "m", "hard_window"}, not_negative(""),
                  "|y| at which forces are cut; 0: twice window_m");
  describe_number(
      v, c, c.deviation_m, {"deviation_m", "m", "deviation"}, not_negative(""),
      "largest difference from the motion predicted from the forces; the loop is opened and the "
      "stage braked if it is exceeded. 0: half of window_m; ignored for accelerations");
  describe_number(v, c, c.speed_m_s, {"speed_m_s", "m/s", "speed"}, positive(""),
                  "largest speed; the stage is braked if it is exceeded; inf: the speed that full "
                  "force can stop");
  v.require(
      c.hard_window_m == 0.0 || c.hard_window_m >= c.window_m, "hard_window_m",
      fmt::format(
          "hard_window_m: {} {} is less than window_m: {}; write a larger value, or omit the key",
          c.hard_window_m, c.channel.unit, c.window_m));
  add_channel(v, std::move(c), list);
}

void describe_plate(ConfigVisitor& v, PlantSpec& p) {
  v.number("length_x_m", p.length_x_m, positive("m"), kRequired, "size of the plate along x");
  v.number("length_y_m", p.length_y_m, positive("m"), kRequired, "size of the plate along y");
  v.number("first_mode_hz", p.first_mode_hz, positive("Hz"), kRequired,
           "scales the stiffness of the plate");
  v.number("poisson_ratio", p.poisson_ratio, {"", 0.0, 0.499}, kOptional,
           "Poisson's ratio of the plate");
  count(v, "modes", p.flexible_modes, 0, 40, kRequired, "number of flexible modes");
  v.numbers("damping", p.flexible_damping, {"", 0.0, 0.999}, {1}, kRequired,
            "damping ratio of each mode; the last one repeats");
}

void describe_in_plane_mode(ConfigVisitor& v, std::vector<InPlaneModeConfig>& list) {
  InPlaneModeConfig m;
  v.number("natural_frequency_hz", m.natural_frequency_hz, positive("Hz"), kRequired, "undamped");
  v.number("damping_ratio", m.damping_ratio, {"", 0.0, 0.999}, kRequired,
           "fraction of critical damping");
  v.named_numbers("actuators", m.actuators, any_number("kg^-1/2"), kRequired,
                  "mass-normalized shape at the actuators that drive it");
  v.named_numbers("sensors", m.sensors, any_number("kg^-1/2"), kRequired,
                  "mass-normalized shape at the sensors that measure it");
  list.push_back(std::move(m));
}

void describe_plant(ConfigVisitor& v, StageFile& f) {
  PlantSpec& p = f.config.plant.emplace();
  v.number("mass_kg", p.mass_kg, positive("kg"), kRequired, "moving mass");
  v.numbers("inertia_kg_m2", f.inertia_kg_m2, positive("kg m^2"), {3, 3}, kRequired,
            "about x, y, z");
  v.numbers("suspension_hz", f.suspension_hz, not_negative("Hz"), {6, 6}, kRequired,
            "suspension by the gravity compensators: x y z Rx Ry Rz; 0: free");
  v.number("suspension_damping", p.suspension_damping, {"", 0.0, 0.999}, kOptional,
           "damping ratio of the suspension");
  group(v, "plate", describe_plate, p, kRequired,
        "free rectangular plate: the flexible modes out of plane");
  items(v, "in_plane_modes", describe_in_plane_mode, f.in_plane_modes, {}, kOptional,
        "flexible modes in plane");
  v.number("cubic_stiffness_n_m3", p.cubic_stiffness_n_m3, not_negative("N/m^3"), kOptional,
           "on the rigid z motion; 0: linear");
  v.number("actuator_saturation_n", p.actuator_saturation_n, not_negative("N"), kOptional,
           "largest force of an actuator; 0: unlimited");
}

void describe_noise(ConfigVisitor& v, SimulationSpec& s) {
  v.number("sensor_m", s.sensor_noise_m, not_negative("m rms"), kOptional,
           "white noise of every sensor, in its unit");
  v.number("sensor_coloured_m", s.sensor_noise_coloured_m, not_negative("m rms"), kOptional,
           "coloured floor of the sensors");
  v.number("sensor_corner_hz", s.sensor_noise_corner_hz, positive("Hz"), kOptional,
           "corner of the coloured floor");
  v.number("force_n", s.force_noise_n, not_negative("N rms"), kOptional,
           "white force disturbance at every actuator, in its unit");
  v.number("sensor_quantum_m", s.sensor_quantum_m, not_negative("m"), kOptional,
           "step of the converters of the sensors; 0: none");
  v.number("actuator_quantum_n", s.actuator_quantum_n, not_negative("N"), kOptional,
           "step of the converters of the actuators; 0: none");
  count(v, "seed", s.seed, 0, std::numeric_limits<std::int64_t>::max(), kOptional,
        "the same seed gives the same noise");
}

void describe_notch(ConfigVisitor& v, std::vector<AxisController::Notch>& list) {
  AxisController::Notch n;
  v.number("frequency_hz", n.frequency_hz, positive("Hz"), kRequired, "frequency of the notch");
  v.number("zero_damping", n.zero_damping, {"", 0.0, 1.0}, kRequired,
           "damping ratio of its numerator");
  v.number("pole_damping", n.pole_damping, {"", 0.0, 1.0, true}, kRequired,
           "damping ratio of its denominator");
  list.push_back(n);
}

void describe_axis(ConfigVisitor& v, AxisController& a) {
  std::size_t emergency = a.brake ? 0 : 1;
  v.number("crossover_hz", a.crossover_hz, positive("Hz"), kRequired,
           "crossover frequency of the open loop");
  v.number("gain", a.gain, not_negative("N/m or N m/rad"), kOptional,
           "gain of the controller; 0: from the crossover and the inertia");
  v.number("integrator_hz", a.integrator_hz, not_negative("Hz"), kOptional,
           "corner of the integrator; 0: none");
  v.number("lead_zero_hz", a.lead_zero_hz, not_negative("Hz"), kOptional,
           "zero of the lead; 0: none");
  v.number("lead_pole_hz", a.lead_pole_hz, not_negative("Hz"), kOptional,
           "pole of the lead; 0: none");
  v.number("lowpass_hz", a.lowpass_hz, not_negative("Hz"), kOptional,
           "corner of the second-order low pass; 0: none");
  v.number("lowpass_damping", a.lowpass_damping, {"", 0.0, 1.0, true}, kOptional,
           "damping ratio of the low pass");
  items(v, "notches", describe_notch, a.notches, {}, kOptional, "second-order notches");
  v.choice("emergency", emergency, {"brake", "cut"}, kOptional,
           "action if the loop is faulty. brake: brake the known motion; cut: zero force");
  a.brake = emergency == 0;
}

void describe_controller(ConfigVisitor& v, StageFile& f) {
  for (std::size_t i = 0; i < kRigidAxes; ++i)
    group(v, kRigidAxisNames[i], describe_axis, f.axes[i], kOptional,
          "controller of this degree of freedom; omitted: open loop");
  for (const ChannelConfig& sensor : f.sensors) f.linear.sensors.push_back(sensor.channel.name);
  for (const ChannelConfig& actuator : f.actuators)
    f.linear.actuators.push_back(actuator.channel.name);
  describe_linear_controller(v, f.linear);
  const bool of_axes =
      std::ranges::any_of(f.axes, [](const AxisController& a) { return a.crossover_hz > 0.0; });
  v.require(int{of_axes} + int{f.linear.has_state_space} + int{!f.linear.transfer.empty()} <= 1,
            f.linear.has_state_space ? "state_space" : "transfer",
            "controller: write axes, state_space or transfer, not several of them");
}

void describe_fault(ConfigVisitor& v, std::vector<FaultConfig>& list) {
  FaultConfig f;
  using Kind = SimulationSpec::Fault::Kind;
  std::vector<std::string> kinds = words_of<Kind>();
  kinds.erase(kinds.begin());  // none
  auto kind = static_cast<std::size_t>(Kind::dead_sensor) - 1;
  v.choice("kind", kind, kinds, kRequired, "kind of the fault");
  f.fault.kind = static_cast<Kind>(kind + 1);
  v.text("channel", f.channel, kOptional,
         "name of the sensor or actuator; if omitted, kinds with a value act on all");
  f.fault.channel = -1;
  count(v, "mode", f.fault.channel, -1, std::numeric_limits<int>::max(), kOptional,
        "mode_frequency, mode_damping: 0 to 5 for x y z Rx Ry Rz on the suspension, then flexible "
        "modes of the plate by frequency, then in_plane_modes; -1: all flexible modes");
  const FaultTraits traits = fault_traits(f.fault.kind);
  const bool of_mode = traits.target == FaultTarget::mode;
  const bool of_channel =
      traits.target == FaultTarget::sensor || traits.target == FaultTarget::actuator;
  v.require(!of_channel || traits.may_be_all || !f.channel.empty(), "channel",
            "a fault of this kind needs 'channel: NAME'");
  v.require(!of_mode || f.channel.empty(), "channel",
            "channel: a fault of this kind acts on a mode; write 'mode: NUMBER'");
  v.require(of_mode || f.fault.channel == -1, "mode",
            "mode: a fault of this kind does not act on a mode; remove the key");
  count(v, "from_cycle", f.fault.from_cycle, 0, std::numeric_limits<std::int64_t>::max(), kOptional,
        "cycle of the run, 0-based");
  count(v, "cycles", f.fault.cycles, 1, std::numeric_limits<std::int64_t>::max(), kOptional,
        "missed_cycle: number of cycles");
  v.number("value", f.fault.value, any_number(""), kOptional,
           "sensor_offset: m; sensor_drift: m/s; actuator_gain, sensor_gain: factor, -1 reversed, "
           "0 dead; sensor_noise: factor; mode_frequency, mode_damping: relative change; "
           "extra_delay: samples; added_mass: kg");
  v.number("ramp_s", f.fault.ramp_s, not_negative("s"), kOptional,
           "the change grows linearly over this time; 0: a step");
  v.require(f.fault.ramp_s == 0.0 || traits.may_ramp, "ramp_s",
            "ramp_s: a fault of this kind cannot be gradual; remove the key");
  v.require(f.fault.kind != Kind::extra_delay || f.fault.value >= 1.0, "value",
            "value: extra_delay needs at least 1 sample");
  count(v, "run", f.fault.run, -1, 1000000, kOptional, "0-based; -1: every run");
  list.push_back(std::move(f));
}

void describe_plugin(ConfigVisitor& v, PluginSpec& plugin) {
  std::string library = plugin.library.string();
  v.text("library", library, kRequired,
         "shared library with the interface of stageid_backend.h; relative to this file");
  plugin.library = library;
  v.named_texts("keys", plugin.keys, kOptional, "settings passed to the library");
}

/// A value within its limits must fit on the wire, because the encoder saturates.
void require_range(ConfigVisitor& v, const char* key, const std::vector<double>& ranges,
                   const std::vector<ChannelConfig>& channels, double ChannelConfig::*limit,
                   const char* limit_key) {
  if (ranges.size() != 1 && ranges.size() != channels.size()) return;  // reported elsewhere
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const double range = ranges[std::min(i, ranges.size() - 1)];
    const double wanted = channels[i].*limit;
    const std::string& unit = channels[i].channel.unit;
    if (!std::isfinite(wanted) || can_range_holds(range, wanted)) continue;
    v.require(false, key,
              fmt::format("{}: {} {} cannot represent {}: {} {} of '{}'; write more than {}, or "
                          "omit the key for 1.25 times {}",
                          key, range, unit, limit_key, wanted, unit, channels[i].channel.name,
                          wanted, limit_key));
    return;
  }
}

void require_ranges(ConfigVisitor& v, const StageFile& f) {
  require_range(v, "actuator_range_n", f.can.actuator_range_n, f.actuators, &ChannelConfig::limit_n,
                "limit_n");
  require_range(v, "sensor_range_m", f.can.sensor_range_m, f.sensors, &ChannelConfig::window_m,
                "window_m");
}

}  // namespace

void describe_stage_file(ConfigVisitor& v, StageFile& f) {
  StageConfig& config = f.config;
  StageSpec& s = config.spec;
  auto backend = static_cast<std::size_t>(config.backend);
  v.choice("format", f.format, {"stageid-stage"}, kRequired, "file type");
  v.text("name", s.info.name, kRequired, "name of the stage");
  v.choice("backend", backend, words_before(Backend::replay), kOptional, "back end of the stage");
  config.backend = static_cast<Backend>(backend);
  v.number("sample_rate_hz", s.info.sample_rate_hz, positive("Hz"), kRequired,
           "sample rate of the loop");
  v.number("delay_s", s.info.delay_s, not_negative("s"), kOptional,
           "delay from the computed command to the change of the hold; any number of samples");
  items(v, "actuators", describe_actuator, f.actuators, {1, 64}, kRequired,
        "in the order of the log");
  items(v, "sensors", describe_sensor, f.sensors, {1, 64}, kRequired, "in the order of the log");
  v.number("stuck_sensor_s", s.limits.stuck_sensor_s, not_negative("s"), kOptional,
           "stop if a sensor repeats one value for this long; 0 disables the check");
  v.number("ramp_s", config.ramp_s, not_negative("s"), kOptional,
           "time in which a stop ramps the excitation to zero, in closed loop if the loop can be "
           "trusted");
  choose(v, "between_runs", config.between_runs, kOptional,
         "release: forces are cut after every run; hold: the loop stays closed between the runs of "
         "an experiment");
  v.number("thermal_time_constant_s", f.thermal_time_constant_s, positive("s"), kOptional,
           "time constant of the average that thermal_rms_n limits");
  group(v, "plant", describe_plant, f, config.backend == Backend::sim ? kRequired : kOptional,
        "the simulated stage. Optional for other back ends, which without it need a prior to test "
        "the loop and to predict signals");
  group(v, "noise", describe_noise, config.simulation, kOptional, "noise of the simulated stage");
  v.group_or_text(
      "controller", [&](ConfigVisitor& controller) { describe_controller(controller, f); },
      f.controller, kRequired,
      "controllers of x, y, z, Rx, Ry, Rz; or state_space or transfer, discrete at sample_rate_hz; "
      "or a file with one of these two (.yaml, .json, .mat, .npz, .h5, .csv), relative to this "
      "one; or peer: the stage closes the loop itself");
  v.number("pace", config.pace, not_negative(""), kOptional,
           "0: virtual time, as fast as possible; 1: wall clock");
  group(v, "realtime", describe_real_time, config.real_time, kOptional,
        "settings of the loop thread; ignored in virtual time");
  describe_modbus_groups(v, config.backend == Backend::modbus, config.modbus, config.supervisor);
  v.group(
      "plugin", [&](ConfigVisitor& keys) { describe_plugin(keys, config.plugin.emplace()); },
      config.backend == Backend::plugin ? kRequired : kOptional,
      "a user-written back end, see docs/plugins.md");
  items(v, "faults", describe_fault, f.faults, {}, kOptional,
        "injected faults and changes of the plant, to test the safety functions and monitoring");
  v.group(
      "can",
      [&](ConfigVisitor& can) {
        describe_can(can, f.can);
        require_ranges(can, f);
      },
      kOptional,
      "connection of the stage over CAN FD; needed by backend can and by 'stageid node --can'");
}

}  // namespace stageid
