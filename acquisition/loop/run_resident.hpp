#pragma once

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/record/run_writer.hpp"
#include "excitation/plan/experiment_plan.hpp"
#include "hal/stage/resident_stage.hpp"

namespace stageid {

/// Performs every run of the plan on a stage that closes the loop by itself: upload, arm, wait, download, log.
/// The log is the same as that of run_experiment(): rows of u, y and status.
///
/// If the stage ends a run early, the recorded part is logged as incomplete, and the experiment ends. The loss
/// of the stage and a failure of the log end the experiment too.
/// @throws std::invalid_argument if the log was made for another plan or stage, or a run is longer
/// than the stage can record.
ExperimentResult run_resident_experiment(const ExperimentPlan& plan, ResidentStage& stage,
                                         RunWriter& log, const RunExperimentOptions& options);

}  // namespace stageid
