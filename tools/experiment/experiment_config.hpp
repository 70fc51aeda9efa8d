#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "estimation/request/fit_request.hpp"
#include "excitation/plan/experiment_plan.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tools/config/config_visitor.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid {

/// Design of the excitation level within the limits.
struct LimitRequest {
  std::filesystem::path prior;  ///< frf.h5 or model.json
  double safety = 0.9;          ///< largest predicted utilization of any limit
  double velocity_m_s = 0.0;    ///< of every sensor; 0: no limit
};

/// A validated experiment file and its stage file.
struct ExperimentConfig {
  std::filesystem::path file;
  std::string text;  ///< of the file, kept for the log
  StageConfig stage;
  LineSpec lines;
  std::vector<int> listed_lines;  ///< excited instead of those of `lines`; empty: none
  int samples_per_period = 0;
  ExperimentSpec experiment;           ///< if `limits` is set, levels are still to be designed
  std::optional<LimitRequest> limits;  ///< level.limits
  FrfOptions frf;
  FitRequest fit;
  int validation_realization = -1;  ///< 0-based; -1: no realization is held back
  std::string measurement_id;       ///< fingerprint of everything that determines the measurement
};

/// @throws FileError, FormatErrors of this file and the stage file.
ExperimentConfig load_experiment_config(const std::filesystem::path& file);

/// Keys of the section `frf`.
void describe_frf_keys(ConfigVisitor& visitor, FrfOptions& options);

/// The keys of an experiment file. Used by `stageid config schema`.
void describe_experiment_keys(ConfigVisitor& visitor);

}  // namespace stageid
