#include "hal/simulator/simulated_stage.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/simulator/fault_script.hpp"
#include "hal/simulator/modal_plant.hpp"
#include "hal/simulator/noise.hpp"
#include "hal/stage/pacer.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kHeaveMode = 2;  // of plant_modes(): x y z ...

const SimulationSpec& checked(const SimulationSpec& spec, double pace) {
  const std::pair<const char*, double> fields[] = {
      {"noise sensor_m", spec.sensor_noise_m},
      {"noise sensor_coloured_m", spec.sensor_noise_coloured_m},
      {"noise force_n", spec.force_noise_n},
      {"noise sensor_quantum_m", spec.sensor_quantum_m},
      {"noise actuator_quantum_n", spec.actuator_quantum_n},
      {"pace", pace}};
  for (const auto& [field, value] : fields)
    require(value >= 0.0 && std::isfinite(value), "stage: {} is {}; must be 0 or more", field,
            value);
  const double corner_hz = spec.sensor_noise_corner_hz;
  require(corner_hz > 0.0 && std::isfinite(corner_hz),
          "stage: noise sensor_corner_hz is {}; must be positive", corner_hz);
  return spec;
}

NoiseSpec noise_of(const StageInfo& info, const SimulationSpec& spec) {
  return {static_cast<Eigen::Index>(info.actuators.size()),
          static_cast<Eigen::Index>(info.sensors.size()),
          info.sample_rate_hz,
          spec.force_noise_n,
          spec.sensor_noise_m,
          spec.sensor_noise_coloured_m,
          spec.sensor_noise_corner_hz};
}

StageInfo info_of(StageInfo info, double pace) {
  if (info.backend.empty()) info.backend = "sim";
  if (info.maximum_rate_hz == 0.0) info.maximum_rate_hz = info.sample_rate_hz;
  info.clock = pace > 0.0 ? Clock::wall : Clock::virtual_time;
  if (pace > 0.0) info.pace = pace;
  return info;
}

void quantize(Eigen::ArrayXd& values, double quantum) {
  for (double& value : values) value = quantum * std::nearbyint(value / quantum);
}

}  // namespace

struct SimulatedStage::State {
  State(const StageInfo& stage, const PlantSpec& of_plant, const SimulationSpec& of_simulation,
        double pace)
      : spec(of_simulation),
        plant_spec(of_plant),
        info(info_of(stage, pace)),
        modes(plant_modes(stage, plant_spec)),
        plant(modes, stage.delay_s, stage.sample_rate_hz),
        noise(noise_of(stage, spec)),
        pacer(stage.sample_rate_hz, pace),
        faults(spec.faults, stage, modes),
        u(Eigen::ArrayXd::Zero(plant.actuators())),
        commanded(Eigen::ArrayXd::Zero(plant.actuators())),
        applied(Eigen::ArrayXd::Zero(plant.actuators())),
        y(Eigen::ArrayXd::Zero(plant.sensors())),
        last_y(Eigen::ArrayXd::Zero(plant.sensors())),
        all_sensors(all_bits(stage.sensors.size())) {}

  SimulationSpec spec;
  PlantSpec plant_spec;
  StageInfo info;
  std::vector<PlantMode> modes;
  ModalPlant plant;
  StageNoise noise;
  Pacer pacer;
  FaultScript faults;
  Eigen::ArrayXd u;          // input of the plant, including disturbance
  Eigen::ArrayXd commanded;  // last received command
  Eigen::ArrayXd applied;    // output of the amplifiers
  Eigen::ArrayXd y;
  Eigen::ArrayXd last_y;
  std::uint64_t all_sensors;
  std::uint64_t cycle = 0;
  int run = -1;
  bool running = false;

  // Computes the amplifiers' output. @returns false if the command is not finite and was refused.
  bool take_command(std::span<const double> command, bool missed, bool off) noexcept {
    const bool good = missed || all_finite(command);
    if (!missed && good) std::copy(command.begin(), command.end(), commanded.begin());
    u = commanded;
    if (off) u.setZero();
    if (spec.actuator_quantum_n > 0.0) quantize(u, spec.actuator_quantum_n);
    if (plant_spec.actuator_saturation_n > 0.0)
      u = u.min(plant_spec.actuator_saturation_n).max(-plant_spec.actuator_saturation_n);
    if (!faults.empty() && !off)
      faults.drive(cycle, {applied.data(), command.size()}, {u.data(), command.size()});
    applied = u;
    return good;
  }

  void drive() noexcept {
    noise.next();
    u += Eigen::Map<const Eigen::ArrayXd>(noise.force_n(), u.size());
    if (plant_spec.cubic_stiffness_n_m3 > 0.0) {
      // The nonlinear force is sampled and held over the interval, so the discretization remains exact.
      const double shape = 1.0 / std::sqrt(plant_spec.mass_kg);
      const double z_m = shape * plant.coordinate(kHeaveMode);
      plant.add_modal_force(kHeaveMode, -shape * plant_spec.cubic_stiffness_n_m3 * z_m * z_m * z_m);
    }
    plant.step(u.data());
  }

  void measure() noexcept {
    last_y = y;
    plant.output(y.data());
    y += Eigen::Map<const Eigen::ArrayXd>(noise.sensor_m(), y.size());
    if (spec.sensor_quantum_m > 0.0) quantize(y, spec.sensor_quantum_m);
  }
};

SimulatedStage::SimulatedStage(const StageInfo& info, const PlantSpec& plant,
                               const SimulationSpec& simulation, double pace)
    : state_(std::make_unique<State>(info, plant, checked(simulation, pace), pace)) {
  for (const SimulationSpec::Fault& fault : simulation.faults)
    require(
        fault.kind != SimulationSpec::Fault::Kind::added_mass || plant.cubic_stiffness_n_m3 == 0.0,
        "faults: added_mass needs a linear plant; remove it, or set cubic_stiffness_n_m3 to 0");
}

SimulatedStage::~SimulatedStage() = default;

const StageInfo& SimulatedStage::info() const noexcept { return state_->info; }

void SimulatedStage::displacement(std::span<double> y_m) const noexcept {
  if (y_m.size() == state_->info.sensors.size()) state_->plant.output(y_m.data());
}

void SimulatedStage::start(std::uint64_t run_seed, Inputs& first) {
  State& s = *state_;
  require(first.y.size() == s.info.sensors.size(),
          "simulated stage: Inputs::y must have one entry per sensor");
  ++s.run;
  s.faults.start_run(s.run);
  s.cycle = 0;
  s.plant.reset();
  s.commanded.setZero();
  s.applied.setZero();
  s.y.setZero();
  s.noise.restart(s.spec.seed, run_seed);
  s.noise.next();
  s.measure();
  s.pacer.restart().put(0, first);
  std::copy(s.y.begin(), s.y.end(), first.y.begin());
  first.valid = s.all_sensors;
  first.node_state = NodeState::operation_enabled;
  s.running = true;
}

Outcome SimulatedStage::exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept {
  State& s = *state_;
  if (!s.running || outputs.u.size() != static_cast<std::size_t>(s.u.size()) ||
      inputs.y.size() != static_cast<std::size_t>(s.y.size())) {
    inputs.valid = 0;
    inputs.node_state = NodeState::switch_on_disabled;
    return Outcome::fault;
  }
  const bool faulty = !s.faults.empty();
  const bool missed = faulty && s.faults.any(SimulationSpec::Fault::Kind::missed_cycle, s.cycle);
  const bool off = faulty && s.faults.any(SimulationSpec::Fault::Kind::interlock, s.cycle);
  const bool accepted = s.take_command(outputs.u, missed, off);
  if (faulty) s.faults.retune(s.cycle, s.plant);
  s.drive();
  if (faulty) s.faults.amplify(s.cycle, {s.noise.sensor_m(), inputs.y.size()});
  s.measure();
  const std::span<double> fresh{s.y.data(), inputs.y.size()};
  const std::uint64_t missing =
      faulty ? s.faults.spoil(s.cycle, fresh, {s.last_y.data(), inputs.y.size()}) : 0;
  const Pacer::Instant now = s.pacer.wait();

  now.put(++s.cycle, inputs);
  inputs.node_state = off || !accepted ? NodeState::fault : NodeState::operation_enabled;
  inputs.valid = missed ? 0 : s.all_sensors & ~missing;
  if (missed) {
    s.y = s.last_y;
  } else {
    std::copy(fresh.begin(), fresh.end(), inputs.y.begin());
  }
  if (off || !accepted) return Outcome::fault;
  if (missed) return Outcome::stale;
  if (missing != 0) return Outcome::incomplete;
  return now.too_late(deadline) ? Outcome::late : Outcome::ok;
}

void SimulatedStage::stop() noexcept {
  state_->running = false;
  state_->commanded.setZero();
}

}  // namespace stageid
