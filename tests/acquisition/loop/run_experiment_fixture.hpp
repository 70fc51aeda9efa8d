#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "excitation/plan/experiment_plan.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/analytic_stage.hpp"

namespace stageid::test {

inline constexpr int kPlanPeriod = 100;

/// Runs of one transient period and `periods` more, at 1 kHz. The axes have another order than the actuators.
inline ExperimentPlan small_plan(int realizations = 2, int periods = 2,
                                 std::vector<ExcitationAxis> axes = {{"u3", 1.0, {}},
                                                                     {"u1", 0.5, {}}}) {
  ExperimentSpec spec;
  spec.axes = std::move(axes);
  spec.realizations = realizations;
  spec.periods = periods;
  spec.transient_periods = 1;
  spec.seed = 17;
  return {FrequencyGrid::band(1000.0, kPlanPeriod, {.low_hz = 10.0, .high_hz = 400.0}), spec};
}

/// Measures a plan with an analytic stage.
struct RunExperimentTest : testing::Test {
  static constexpr int kActuators = 3;
  static constexpr int kSensors = 2;
  static constexpr std::uint64_t kSamples = 3 * kPlanPeriod;

  RunExperimentTest() {
    auto stage = std::make_unique<AnalyticStage>(kActuators, kSensors);
    stage->noise = 1e-3;
    stage->spoil_missing = false;  // a driver holds the last measurement, as LimitedStage requires
    StageLimits limits;
    limits.actuator_n = Eigen::VectorXd::Constant(kActuators, 50.0);
    use(std::move(stage), limits);
  }

  void use(std::unique_ptr<AnalyticStage> stage, const StageLimits& limits) {
    inner_ = stage.get();
    stage_ = std::make_unique<LimitedStage>(std::move(stage), limits);
    controller_ = std::make_unique<MotionController>(analytic_controller(inner_->info()));
  }

  void use_wall_clock(const StageLimits& limits = {}) {
    use(std::make_unique<AnalyticStage>(kActuators, kSensors, 1000.0, Clock::wall), limits);
  }

  SlogWriter create(const std::string& name) const {
    return SlogWriter::create(directory_ / name, experiment_log_info(plan_, stage_->info()));
  }

  ExperimentResult measure(SlogWriter& log, const RunExperimentOptions& options = {}) {
    return run_experiment(plan_, *stage_, *controller_, log, options);
  }

  /// Measures into a closed log.
  ExperimentResult measure_into(const std::string& name, const RunExperimentOptions& options = {}) {
    SlogWriter log = create(name);
    const ExperimentResult result = measure(log, options);
    log.close(0, result.message.c_str());
    return result;
  }

  TemporaryDirectory directory_;
  ExperimentPlan plan_ = small_plan();
  AnalyticStage* inner_ = nullptr;
  std::unique_ptr<LimitedStage> stage_;
  std::unique_ptr<MotionController> controller_;
};

}  // namespace stageid::test
