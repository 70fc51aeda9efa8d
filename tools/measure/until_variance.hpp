#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "excitation/plan/experiment_plan.hpp"
#include "frf/plant/plant_frf.hpp"

namespace stageid {

/// Decides when an experiment can end. It estimates the response from the log during the measurement, as `stageid frf`
/// does, and compares its mean relative variance (confidence.hpp) with the requested one. The larger of noise
/// and total variance is used, as far as they are known.
class UntilVariance {
 public:
  /// @throws std::invalid_argument unless `variance` is positive and finite.
  UntilVariance(std::filesystem::path log, FrfOptions options, double variance);

  /// The reason to end, or an empty text. A failed estimate does not end it, see failure(). The caller may be a
  /// real-time thread: the work is done in a thread of normal priority.
  std::string enough();

  /// of the last estimate
  const std::optional<double>& reached() const noexcept { return reached_; }
  const std::string& failure() const noexcept { return failure_; }  ///< of the last estimate

 private:
  void look();

  std::filesystem::path log_;
  FrfOptions options_;
  double wanted_;
  std::optional<double> reached_;
  int realizations_ = 0;
  std::string failure_;
};

/// Why UntilVariance can never end a plan early, and the remedy; empty if it can.
std::string never_enough(const ExperimentSpec& plan, const FrfOptions& options);

}  // namespace stageid
