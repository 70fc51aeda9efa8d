#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "hal/stage/motion_controller.hpp"
#include "hal/stage/stage.hpp"

namespace stageid::test {

/// A stage whose next measurement can be computed by hand:
///   y_i[n+1] = a y_i[n] + sum_j b_ij u_j[n] + noise(seed, n, i),
/// with a script of outcomes by cycle. It records what it was asked to do.
class AnalyticStage final : public CyclicStage {
 public:
  static constexpr double kPole = 0.9;

  /// b_ij of the plant.
  static double input_gain(Eigen::Index sensor, Eigen::Index actuator) {
    return 1e-3 * (1.0 + 0.5 * static_cast<double>(sensor) - 0.25 * static_cast<double>(actuator));
  }

  AnalyticStage(int actuators, int sensors, double rate_hz = 1000.0,
                Clock clock = Clock::virtual_time, double pace = 1.0)
      : y_(Eigen::VectorXd::Zero(sensors)) {
    info_.name = "analytic";
    info_.backend = "test";
    info_.sample_rate_hz = rate_hz;
    info_.clock = clock;
    info_.pace = pace;
    info_.actuators = channels("u", actuators, "N");
    info_.sensors = channels("y", sensors, "m");
    sent_.reserve(10'000'000 / sizeof(double));
  }

  // The script: what exchange number n (of every run) does instead of `ok`.
  std::map<std::uint64_t, Outcome> outcomes;
  std::map<std::uint64_t, std::uint64_t> valid;   ///< mask of an `incomplete` exchange
  std::map<std::uint64_t, double> first_sensor;   ///< replaces the value of the first sensor
  std::int64_t lateness_ns = 0;                   ///< of every `late` exchange
  int refuse_run = -1;                            ///< start() of this run throws
  std::atomic<bool>* raise_at_refusal = nullptr;  ///< set to true then
  double noise = 0.0;
  bool spoil_missing = true;                          ///< leave NaN where nothing was measured
  std::map<std::uint64_t, std::atomic<bool>*> raise;  ///< set to true at this exchange of any run

  // The record.
  const std::vector<std::uint64_t>& seeds() const { return seeds_; }
  std::uint64_t exchanges() const { return cycle_; }  ///< of the current run
  int stops() const { return stops_; }
  const std::vector<double>& sent() const { return sent_; }  ///< commands of the current run
  std::int64_t last_deadline_ns() const { return last_deadline_ns_; }

  const StageInfo& info() const noexcept override { return info_; }

  void start(std::uint64_t run_seed, Inputs& first) override {
    if (static_cast<int>(seeds_.size()) == refuse_run) {
      if (raise_at_refusal != nullptr) *raise_at_refusal = true;
      throw StageError("analytic: refuses");
    }
    seeds_.push_back(run_seed);
    cycle_ = 0;
    sent_.clear();
    y_.setZero();
    give(first, y_);
    first.valid = all();
  }

  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept override {
    last_deadline_ns_ = deadline.t_ns;
    if (sent_.size() + outputs.u.size() <= sent_.capacity()) {
      sent_.insert(sent_.end(), outputs.u.begin(), outputs.u.end());
    }
    for (Eigen::Index i = 0; i < y_.size(); ++i) {
      y_[i] *= kPole;
      for (std::size_t j = 0; j < outputs.u.size(); ++j) {
        y_[i] += input_gain(i, static_cast<Eigen::Index>(j)) * outputs.u[j];
      }
      if (noise != 0.0) y_[i] += noise * random(static_cast<std::uint64_t>(i));
    }
    if (const auto flag = raise.find(cycle_); flag != raise.end()) flag->second->store(true);
    const auto scripted = outcomes.find(cycle_);
    const Outcome outcome = scripted == outcomes.end() ? Outcome::ok : scripted->second;
    const auto shown = first_sensor.find(cycle_);
    const auto mask = valid.find(cycle_);
    ++cycle_;
    inputs.valid = mask == valid.end() ? all() : mask->second;
    if (outcome == Outcome::ok || outcome == Outcome::late || outcome == Outcome::bus_passive ||
        outcome == Outcome::limit || outcome == Outcome::incomplete) {
      give(inputs, y_);
      if (shown != first_sensor.end()) inputs.y[0] = shown->second;
    } else if (spoil_missing) {
      // Values that a driver may leave behind; they must not be used.
      for (double& value : inputs.y) value = std::numeric_limits<double>::quiet_NaN();
    }
    inputs.t_rx_ns = inputs.t_sample_ns + (outcome == Outcome::late ? lateness_ns : 0);
    return outcome;
  }

  void stop() noexcept override { ++stops_; }

 private:
  static std::vector<Channel> channels(const std::string& letter, int count, const char* unit) {
    std::vector<Channel> list;
    for (int i = 1; i <= count; ++i) list.push_back({letter + std::to_string(i), unit});
    return list;
  }

  std::uint64_t all() const { return (std::uint64_t{1} << y_.size()) - 1; }

  void give(Inputs& inputs, const Eigen::VectorXd& y) noexcept {
    for (Eigen::Index i = 0; i < y.size(); ++i) inputs.y[i] = y[i];
    inputs.cycle = cycle_;
    inputs.t_sample_ns =
        static_cast<std::int64_t>(1e9 * static_cast<double>(cycle_) / info_.sample_rate_hz);
    inputs.t_rx_ns = inputs.t_sample_ns;
  }

  double random(std::uint64_t channel) const noexcept {
    std::uint64_t z = seeds_.back() + cycle_ * 0x9E3779B97F4A7C15U + channel * 0xD1B54A32D192ED03U;
    z = (z ^ (z >> 32)) * 0xD6E8FEB86659FD93U;
    z = (z ^ (z >> 32)) * 0xD6E8FEB86659FD93U;
    return static_cast<double>(z >> 11) * 0x1p-53 - 0.5;
  }

  StageInfo info_;
  Eigen::VectorXd y_;
  std::vector<std::uint64_t> seeds_;
  std::vector<double> sent_;
  std::uint64_t cycle_ = 0;
  std::int64_t last_deadline_ns_ = -1;
  int stops_ = 0;
};

/// One logical axis from the mean of the sensors to all actuators; a stable loop with
/// AnalyticStage.
inline MotionControllerSpec analytic_controller(const StageInfo& info, double gain = 2.0) {
  const auto sensors = static_cast<Eigen::Index>(info.sensors.size());
  const auto actuators = static_cast<Eigen::Index>(info.actuators.size());
  MotionControllerSpec spec;
  spec.sample_rate_hz = info.sample_rate_hz;
  spec.sensor_decoupling =
      Eigen::MatrixXd::Constant(1, sensors, 1.0 / static_cast<double>(sensors));
  spec.actuator_decoupling = Eigen::MatrixXd::Constant(actuators, 1, 1.0);
  AxisController axis;
  axis.crossover_hz = 0.02 * info.sample_rate_hz;
  axis.gain = gain;
  axis.integrator_hz = 0.002 * info.sample_rate_hz;
  axis.lead_zero_hz = 0.01 * info.sample_rate_hz;
  axis.lead_pole_hz = 0.1 * info.sample_rate_hz;
  axis.lowpass_hz = 0.2 * info.sample_rate_hz;
  spec.axes = {axis};
  return spec;
}

}  // namespace stageid::test
