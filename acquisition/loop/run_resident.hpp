#pragma once

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/record/run_writer.hpp"
#include "excitation/plan/experiment_plan.hpp"
#include "hal/stage/resident_stage.hpp"

namespace stageid {

/// Performs every run of the plan on a stage that closes the loop by itself: upload, arm, wait,
/// download, log. The log is the one run_experiment() writes: rows of u, y and status.
///
/// A run that the stage ends before its time is logged as far as it was recorded, incomplete, and
/// ends the experiment. So does a stage that is lost on the way.
/// @throws std::invalid_argument if the log was made for another plan or stage, or a run is longer
/// than the stage can record.
ExperimentResult run_resident_experiment(const ExperimentPlan& plan, ResidentStage& stage,
                                         RunWriter& log, const RunExperimentOptions& options);

}  // namespace stageid
