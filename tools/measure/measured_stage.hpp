#pragma once

#include <memory>
#include <string>
#include <vector>

#include "acquisition/loop/run_experiment.hpp"
#include "tools/measure/measurement.hpp"

namespace stageid {

/// The stage of a measurement behind the back end that is asked for, and how an experiment is
/// performed on it: the host closes the loop, or the stage does.
class MeasuredStage {
 public:
  virtual ~MeasuredStage() = default;
  virtual const StageInfo& info() const noexcept = 0;
  virtual ExperimentResult perform(RunWriter& log, const RunExperimentOptions& options) = 0;
  /// After perform(): what the stage itself knows of the end becomes part of message and exit code.
  virtual void explain(MeasurementResult& result) const = 0;
  /// The first limit that this side of the wires saw.
  virtual LimitViolation violation() const noexcept = 0;
};

/// @throws std::invalid_argument if the stage file does not have what the back end needs.
void require_backend(const ExperimentConfig& config, Backend backend);

/// @param skip runs that are not performed
/// @throws std::invalid_argument if the files lack what the back end needs, or it cannot carry the
/// experiment. @throws StageError, FileError, FormatError
std::unique_ptr<MeasuredStage> make_measured_stage(const ExperimentConfig& config,
                                                   const ExperimentPlan& plan,
                                                   const MeasurementRequest& request,
                                                   const std::vector<RunId>& skip);

}  // namespace stageid
