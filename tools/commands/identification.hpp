#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "estimation/modal/validation.hpp"
#include "estimation/request/fit_request.hpp"
#include "estimation/search/fit_additive_model.hpp"
#include "frf/periods/health_finding.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/steps/model_verdict.hpp"
#include "tools/steps/truth_comparison.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

struct IdentificationRequest {
  std::filesystem::path directory;
  bool resume = false;
  bool force = false;
  int threads = 0;
};

/// The main job, step by step, into one directory:
///   excitation.h5, run.slog, frf.h5, frf_validation.h5, modes.json, model.json, model.h5, model.csv,
///   summary.json, report.html
/// With `resume`, a step is skipped if its output exists, was made by the same version from the same inputs with the
/// same request, and is not older than its input.
class Identification {
 public:
  Identification(const ExperimentConfig& config, IdentificationRequest request, Console& console);

  /// @returns the exit code: kDone, kNotTrustworthy, or that of the measurement.
  /// @throws FileError, FormatError, std::invalid_argument, StageError, Interrupted
  int run();

 private:
  std::filesystem::path path(const char* name) const { return request_.directory / name; }
  void design();
  int measure_all();
  void estimate();
  FrfEstimate estimate_into(const char* name, const std::vector<int>& realizations);
  void pick();
  void fit();
  bool fit_is_up_to_date(const FitSetup& setup, const std::string& frf_fingerprint) const;
  void check_model();
  void write_outputs();
  void print_summary() const;
  nlohmann::ordered_json summary() const;
  void finish_step(const char* name, double seconds, std::string note);
  std::vector<int> fitted_realizations() const;

  struct Step {
    std::string name;
    double seconds = 0.0;
    std::string note;
  };

  const ExperimentConfig& config_;
  IdentificationRequest request_;
  Console& console_;
  ExperimentPlan plan_;
  int exit_code_ = 0;
  ModelVerdict verdict_;
  std::vector<Step> steps_;
  std::vector<std::string> notes_;
  std::vector<Finding> health_;
  std::optional<FrfEstimate> frf_;
  std::optional<FrfEstimate> validation_frf_;
  std::optional<FitSetup> setup_;
  std::vector<ModeCandidate> chosen_modes_;
  AdditiveModel model_;
  Eigen::MatrixXd model_variance_;
  std::optional<Validation> validation_;
  std::optional<TruthComparison> truth_;
  nlohmann::ordered_json summary_;
};

}  // namespace stageid
