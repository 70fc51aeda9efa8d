#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "frf/response/frf_estimate.hpp"
#include "hal/simulator/simulated_stage.hpp"

namespace stageid {

/// A mode of the simulated plant and the estimated one that is nearest to it.
struct ModeComparison {
  double true_frequency_hz = 0.0;
  double true_damping = 0.0;
  bool found = false;
  double frequency_hz = 0.0;
  double damping = 0.0;
  double frequency_std_hz = 0.0;  ///< 0: unknown
  double damping_std = 0.0;
  double frequency_deviation() const;  ///< in standard deviations; 0 if they are unknown
  double damping_deviation() const;
};

struct TruthComparison {
  std::vector<ModeComparison> modes;  ///< every true mode in the band
  std::vector<double> extra_hz;       ///< estimated modes on the lines that belong to no true one
  std::vector<double> outside_hz;     ///< estimated modes below or above the lines
  /// Of the model against the exact plant, over lines and channels that respond; NaN: none does.
  double relative_rms_error = 0.0;
  double normalized_error = 0.0;  ///< sqrt(sum |P - G|^2 / sum |G|^2)
};

/// Compares a model with the exact plant of a simulated stage: flexible out-of-plane modes below
/// the last line (one to one, the nearest pairs first), and the response on the lines of `frf`, as
/// the loop saw it.
/// @param frf whose lines, channels and compensation the model was fitted to.
TruthComparison compare_with_truth(const AdditiveModel& model, const FrfEstimate& frf,
                                   const WaferStageSpec& stage);

std::vector<std::string> truth_table(const TruthComparison& comparison);
std::string truth_error_line(const TruthComparison& comparison);
nlohmann::ordered_json truth_json(const TruthComparison& comparison);

}  // namespace stageid
