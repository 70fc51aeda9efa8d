#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "frf/response/frf_estimate.hpp"
#include "hal/simulator/plant_spec.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// Pairs true modes with estimated ones, one to one, the nearest first; every pair differs by less than 5 %.
/// @returns per true mode the index of its estimated one, if there is one
std::vector<std::optional<std::size_t>> pair_with_truth(const std::vector<double>& true_hz,
                                                        const std::vector<double>& estimated_hz);

/// A known mode of a simulated plant.
struct TrueMode {
  double natural_frequency_hz = 0.0;
  double damping_ratio = 0.0;
};

/// An identified mode, a true one, or a pair of both.
struct ModeRow {
  std::optional<double> frequency_hz;
  std::optional<double> damping_ratio;
  std::optional<double> frequency_std_hz;
  std::optional<double> damping_std;
  std::optional<TrueMode> truth;

  /// (estimate - truth) / standard deviation, if all three are known.
  std::optional<double> frequency_deviation() const;
  std::optional<double> damping_deviation() const;
  /// |estimate - truth| / truth of the natural frequency.
  std::optional<double> relative_frequency_error() const;
};

/// Pairs the modes of a model with true ones, see pair_with_truth(). Rows by frequency (that of the truth if nothing was
/// identified).
std::vector<ModeRow> mode_rows(const AdditiveModel& model, std::span<const TrueMode> truth);

struct TruthComparison {
  std::vector<ModeRow> modes;      ///< every true mode in the band
  std::vector<double> extra_hz;    ///< estimated modes on the lines without a true one
  std::vector<double> outside_hz;  ///< estimated modes below or above the lines
  /// Of the model relative to the exact plant, over responding lines and channels; NaN: there are none.
  double relative_rms_error = 0.0;
  double normalized_error = 0.0;  ///< sqrt(sum |P - G|^2 / sum |G|^2)
};

/// Compares a model with the exact plant of a simulated stage: flexible out-of-plane modes below the last line, and the
/// response on the lines of `frf`, as measured in the loop.
/// @param frf with the lines, channels and compensation to which the model was fitted.
TruthComparison compare_with_truth(const AdditiveModel& model, const FrfEstimate& frf,
                                   const StageInfo& info, const PlantSpec& plant);

std::vector<std::string> truth_table(const TruthComparison& comparison);
std::string truth_error_line(const TruthComparison& comparison);
Json truth_json(const TruthComparison& comparison);

}  // namespace stageid
