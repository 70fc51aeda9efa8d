#pragma once

#include <optional>
#include <span>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "tools/report/report.hpp"

namespace stageid {

/// One line of the table of modes: an identified mode, a true one, or both where they belong
/// together.
struct ModeRow {
  std::optional<double> frequency_hz;
  std::optional<double> damping_ratio;
  std::optional<double> frequency_std_hz;
  std::optional<double> damping_std;
  std::optional<TrueMode> truth;

  /// (estimate - truth) / standard deviation, where all three are known.
  std::optional<double> frequency_deviation() const;
  std::optional<double> damping_deviation() const;
  /// |estimate - truth| / truth of the natural frequency.
  std::optional<double> relative_frequency_error() const;
};

/// Pairs the modes of a model with true ones, one to one and in the order of frequency, such that
/// as many as possible pair up and the sum of |f - f_true| / f_true is least; no pair is further
/// apart than `furthest`. Rows by frequency (the truth's where nothing was identified).
std::vector<ModeRow> mode_table(const AdditiveModel& model, std::span<const TrueMode> truth,
                                double furthest = 0.02);

}  // namespace stageid
