#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "excitation/plan/experiment_plan.hpp"
#include "frf/plant/plant_frf.hpp"

namespace stageid {

/// Says when an experiment has measured enough: estimates the response, as `stageid frf` does, from
/// the log that is being written, and compares its mean relative variance (relative_variance.hpp) with
/// the one wanted. Judged is the larger of noise and total variance, of those that are known.
class UntilVariance {
 public:
  /// @throws std::invalid_argument unless `variance` is positive and finite.
  UntilVariance(std::filesystem::path log, FrfOptions options, double variance);

  /// Why it is enough, or nothing. An estimate that fails is not enough; failure() tells why. The
  /// caller may be a real-time thread: the work is done in one of normal priority.
  std::string enough();

  const std::optional<double>& reached() const noexcept { return reached_; }  ///< at the last look
  const std::string& failure() const noexcept { return failure_; }            ///< of the last look

 private:
  void look();

  std::filesystem::path log_;
  FrfOptions options_;
  double wanted_;
  std::optional<double> reached_;
  int realizations_ = 0;
  std::string failure_;
};

/// Why a plan cannot end before its time by UntilVariance, and the remedy; empty if it can.
std::string never_enough(const ExperimentSpec& plan, const FrfOptions& options);

}  // namespace stageid
