#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>

#include "acquisition/prediction/closed_loop_prediction.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/experiment/limited_plan.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid design CONFIG -o excitation.h5
class DesignCommand {
 public:
  DesignCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  void write_limited(const ExperimentConfig& config, const LimitedPlan& limited) const;

  Console& console_;
  std::filesystem::path config_;
  std::filesystem::path output_;
  double accuracy_ = 0.0;
  bool force_ = false;
};

/// The request of the plan and its predicted signals, as a table.
std::vector<std::string> design_table(const ExperimentConfig& config, const ExperimentPlan& plan,
                                      const DesignPrediction& prediction);

/// Warns if the signals of the stage cannot be predicted, see why_unpredictable().
void warn_of_prediction(const ExperimentConfig& config, const Console& console);

/// @throws std::invalid_argument naming the first limit that would be exceeded, and the number of others.
void require_within_limits(const ExperimentConfig& config, const DesignPrediction& prediction);

}  // namespace stageid
