#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "excitation/experiment_plan.hpp"
#include "frf/plant_frf.hpp"
#include "tools/config_visitor.hpp"
#include "tools/fit_request.hpp"
#include "tools/stage_config.hpp"

namespace stageid {

/// An experiment file and the stage file it names, checked through.
struct ExperimentConfig {
  std::filesystem::path file;
  std::string text;  ///< of the file, kept for the log
  StageConfig stage;
  LineSpec lines;
  int samples_per_period = 0;
  ExperimentSpec experiment;
  FrfOptions frf;
  FitRequest fit;
  int validation_realization = -1;  ///< 0-based; -1: none is held back
  std::string measurement_id;       ///< fingerprint of all that decides what is measured
};

/// @throws FileError, FormatError "FILE:LINE:COLUMN: what is wrong; what would be right".
ExperimentConfig load_experiment_config(const std::filesystem::path& file);

/// The plan; drawing its multisines may take a second when crest factors are reduced.
ExperimentPlan make_plan(const ExperimentConfig& config);

/// The keys of an experiment file. Used by `stageid config schema`.
void describe_experiment_keys(ConfigVisitor& visitor);

}  // namespace stageid
