#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hal/simulator/simulated_stage.hpp"
#include "hal/stage/limits.hpp"
#include "hal/stage/stage.hpp"

namespace stageid::test {

/// What a stage really did in one run: u[n] and the y[n] from which it was computed.
struct WitnessedRun {
  std::uint64_t seed = 0;
  std::vector<std::vector<double>> u;  ///< one per exchange
  std::vector<std::vector<double>> y;  ///< one more, the first of start()
};

/// Outlives its stage.
struct Testimony {
  std::vector<WitnessedRun> runs;
  std::vector<std::string> broken;  ///< limits that were not kept
  bool running = false;
  double excursion = 0.0;  ///< the largest true one, relative to the hard window
};

/// Stands between everything that is tested and a simulated stage. It recomputes from the definitions in limits.hpp
/// whether the forces are permitted.
class StageWitness final : public CyclicStage {
 public:
  /// @param limits complete_limits()
  /// @param before called before every exchange with its number, counted over all runs
  StageWitness(std::unique_ptr<SimulatedStage> stage, StageLimits limits, Testimony& testimony,
               std::function<void(std::uint64_t)> before)
      : stage_(std::move(stage)),
        limits_(std::move(limits)),
        testimony_(testimony),
        before_(std::move(before)) {}

  const StageInfo& info() const noexcept override { return stage_->info(); }

  void start(std::uint64_t run_seed, Inputs& first) override {
    stage_->start(run_seed, first);
    testimony_.running = true;
    testimony_.runs.push_back({run_seed, {}, {{first.y.begin(), first.y.end()}}});
    last_.assign(info().actuators.size(), 0.0);
    mean_square_.assign(info().actuators.size(), 0.0);
    beyond_ = false;
  }

  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept override {
    before_(exchanges_++);
    judge(outputs.u);
    const Outcome outcome = stage_->exchange(outputs, inputs, deadline);
    place_.resize(inputs.y.size());
    stage_->displacement(place_);
    for (std::size_t i = 0; i < place_.size(); ++i)
      testimony_.excursion =
          std::max(testimony_.excursion,
                   std::abs(place_[i]) / limits_.hard_window_m[static_cast<Eigen::Index>(i)]);
    WitnessedRun& run = testimony_.runs.back();
    run.u.emplace_back(outputs.u.begin(), outputs.u.end());
    run.y.emplace_back(inputs.y.begin(), inputs.y.end());
    for (std::size_t i = 0; i < inputs.y.size(); ++i)
      beyond_ |= ((inputs.valid >> i) & 1U) != 0 &&
                 std::abs(inputs.y[i]) > limits_.hard_window_m[static_cast<Eigen::Index>(i)];
    return outcome;
  }

  void stop() noexcept override {
    stage_->stop();
    testimony_.running = false;
  }

 private:
  void judge(std::span<const double> u) {
    constexpr double kRounding = 1.0 + 1e-9;
    const double rate_hz = info().sample_rate_hz;
    const double keep = std::exp(-1.0 / (rate_hz * limits_.thermal_time_constant_s));
    if (!testimony_.running) blame("is driven after stop()", 0);
    for (std::size_t j = 0; j < u.size(); ++j) {
      const auto channel = static_cast<Eigen::Index>(j);
      mean_square_[j] = keep * mean_square_[j] + (1.0 - keep) * u[j] * u[j];
      const double warmth = std::sqrt(mean_square_[j]);
      const double step = std::abs(u[j] - last_[j]) * rate_hz;
      // Within its last percent, the thermal limit may lower a force faster than the slew limit permits.
      const bool hot = warmth > 0.99 * limits_.thermal_rms_n[channel];
      if (!std::isfinite(u[j])) blame("is not finite", j);
      if (std::abs(u[j]) > kRounding * limits_.actuator_n[channel]) blame("is too large", j);
      if (warmth > kRounding * limits_.thermal_rms_n[channel]) blame("is too warm", j);
      if (step > kRounding * limits_.slew_n_s[channel] &&
          !(hot && std::abs(u[j]) < std::abs(last_[j])))
        blame("is too fast", j);
      if (beyond_ && u[j] != 0.0 && step < limits_.slew_n_s[channel] / kRounding)
        blame("acts beyond the hard window", j);
      last_[j] = u[j];
    }
  }

  void blame(const char* what, std::size_t actuator) {
    testimony_.broken.push_back(
        fmt::format("force {} {} in exchange {}", actuator, what, exchanges_));
  }

  std::unique_ptr<SimulatedStage> stage_;
  StageLimits limits_;
  Testimony& testimony_;
  std::function<void(std::uint64_t)> before_;
  std::uint64_t exchanges_ = 0;
  std::vector<double> place_;
  std::vector<double> last_;
  std::vector<double> mean_square_;
  bool beyond_ = false;  // a measurement is beyond the hard window
};

}  // namespace stageid::test
