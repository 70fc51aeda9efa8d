#pragma once

#include <optional>
#include <span>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "tools/report/report_page.hpp"

namespace stageid {

/// One row of the table of modes: an identified mode, a true one, or a pair of both.
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
std::vector<ModeRow> mode_table(const AdditiveModel& model, std::span<const TrueMode> truth);

}  // namespace stageid
