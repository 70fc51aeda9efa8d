#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "hal/simulator/rigid_body.hpp"
#include "hal/stage/limited_stage.hpp"
#include "tests/support/stages/simulated_spec.hpp"

namespace stageid::test {

inline constexpr double kStopWindow = 200e-6;  // m
inline constexpr double kStopForce = 650.0;    // N
inline constexpr double kStopMass = 20.0;      // kg
inline constexpr std::uint64_t kFaultCycle = 2000;

/// One levitated axis: 20 kg, 650 N, a window of 200 um, 10 kHz, crossover 60 Hz.
inline SimulatedSpec stop_stage_spec(double controller_gain = 1.0) {
  SimulatedSpec spec;
  spec.info.name = "one axis";
  spec.info.sample_rate_hz = 10e3;
  spec.info.actuators = {{"f", "N", {0, 0, 0}, {0, 0, 1}}};
  spec.info.sensors = {{"s", "m", {0, 0, 0}, {0, 0, 1}}};
  spec.info.delay_s = 130e-6;
  spec.plant.mass_kg = kStopMass;
  spec.plant.inertia_kg_m2[0] = spec.plant.inertia_kg_m2[1] = spec.plant.inertia_kg_m2[2] = 1.0;
  spec.plant.suspension_hz[2] = 0.3;
  spec.plant.suspension_damping = 0.1;
  spec.plant.length_x_m = spec.plant.length_y_m = 0.5;
  spec.plant.first_mode_hz = 200.0;
  spec.plant.flexible_damping = {0.01};
  spec.simulation.sensor_noise_m = 1e-9;
  spec.simulation.force_noise_n = 1e-3;
  spec.simulation.seed = 1;
  std::array<AxisController, kRigidAxes> axes;
  AxisController& axis = axes[2];
  axis.crossover_hz = 60.0;
  axis.integrator_hz = 5.0;
  axis.lead_zero_hz = 18.0;
  axis.lead_pole_hz = 240.0;
  axis.lowpass_hz = 600.0;
  spec.controller =
      motion_controller_spec(spec.info.sample_rate_hz, spec.info.actuators, spec.info.sensors, axes,
                             {kStopMass, kStopMass, kStopMass, 1, 1, 1});
  spec.limits.motion = rigid_motion(spec.controller, spec.info.actuators, spec.info.sensors);
  spec.controller.axes[2].gain *= controller_gain;
  spec.limits.actuator_n = Eigen::VectorXd::Constant(1, kStopForce);
  spec.limits.position_window_m = Eigen::VectorXd::Constant(1, kStopWindow);
  spec.limits.stuck_sensor_s = 0.02;
  return spec;
}

/// Watches where the stage really is and which forces it is given.
class WatchedStage final : public CyclicStage {
 public:
  explicit WatchedStage(const SimulatedSpec& spec)
      : stage_(simulated(spec)),
        rate_hz_(spec.info.sample_rate_hz),
        suspension_rad_s_(2.0 * std::numbers::pi * spec.plant.suspension_hz[2]),
        damping_(spec.plant.suspension_damping),
        now_m_(spec.info.sensors.size()) {
    before_m_ = now_m_;
  }
  const StageInfo& info() const noexcept override { return stage_->info(); }
  void start(std::uint64_t run_seed, Inputs& first) override { stage_->start(run_seed, first); }
  Outcome exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept override {
    ++cycles;
    for (const double u : outputs.u) largest_n = std::max(largest_n, std::abs(u));
    const Outcome outcome = stage_->exchange(outputs, inputs, deadline);
    std::swap(now_m_, before_m_);
    stage_->displacement(now_m_);
    for (const double y : now_m_) largest_m = std::max(largest_m, std::abs(y));
    return outcome;
  }
  void stop() noexcept override { stage_->stop(); }

  /// Largest excursion in the second after the forces were cut, on the suspension alone.
  double coasted_m() const {
    double x = now_m_[0];
    double v = (now_m_[0] - before_m_[0]) * rate_hz_;
    double largest = std::abs(x);
    for (double t = 0.0; t < 1.0; t += 1.0 / rate_hz_) {
      v -= (suspension_rad_s_ * x + 2.0 * damping_ * v) * suspension_rad_s_ / rate_hz_;
      x += v / rate_hz_;
      largest = std::max(largest, std::abs(x));
    }
    return largest;
  }
  /// Of the fastest sensor in the last sample.
  double speed_m_s() const {
    double speed = 0.0;
    for (std::size_t i = 0; i < now_m_.size(); ++i)
      speed = std::max(speed, std::abs(now_m_[i] - before_m_[i]) * rate_hz_);
    return speed;
  }

  double largest_m = 0.0;
  double largest_n = 0.0;
  std::uint64_t cycles = 0;

 private:
  std::unique_ptr<SimulatedStage> stage_;
  double rate_hz_;
  double suspension_rad_s_;
  double damping_;
  std::vector<double> now_m_;
  std::vector<double> before_m_;
};

}  // namespace stageid::test
