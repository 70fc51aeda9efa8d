#pragma once

#include <memory>
#include <vector>

#include "acquisition/loop/run_experiment.hpp"
#include "tools/measure/measurement.hpp"

namespace stageid {

/// The stage of a measurement at the requested back end. The loop of the experiment is closed by the host or by the
/// stage.
class MeasuredStage {
 public:
  virtual ~MeasuredStage() = default;
  virtual const StageInfo& info() const noexcept = 0;
  virtual ExperimentResult perform(RunWriter& log, const RunExperimentOptions& options) = 0;
  /// Adds the stage's own reason for the end, if it has one, to message and exit code, after perform().
  virtual void explain(MeasurementResult& /*result*/) const {}
  /// The first limit violation that the host detected.
  virtual LimitViolation violation() const noexcept { return {}; }
};

/// @throws std::invalid_argument if the stage file does not have what the back end needs.
void require_backend(const ExperimentConfig& config, Backend backend, double pace);

/// @param skip runs to skip
/// @throws std::invalid_argument if the files lack something that the back end needs, or it cannot carry the
/// experiment. @throws StageError, FileError, FormatError
std::unique_ptr<MeasuredStage> make_measured_stage(const ExperimentConfig& config,
                                                   const ExperimentPlan& plan,
                                                   const MeasurementRequest& request,
                                                   const std::vector<RunId>& skip);

}  // namespace stageid
