#include "tools/report/report_modes.hpp"

#include <algorithm>
#include <cmath>

#include "tools/steps/truth_comparison.hpp"

namespace stageid {
namespace {

std::optional<double> deviation(std::optional<double> estimate, std::optional<double> truth,
                                std::optional<double> std) {
  if (!estimate || !truth || !std || !(*std > 0.0)) return std::nullopt;
  return (*estimate - *truth) / *std;
}

std::vector<ModeRow> identified(const AdditiveModel& model) {
  std::vector<ModeRow> rows;
  for (const Submodel& submodel : model.submodels) {
    if (!submodel.is_mode()) continue;
    rows.push_back({.frequency_hz = submodel.natural_frequency_hz(),
                    .damping_ratio = submodel.damping_ratio(),
                    .frequency_std_hz = submodel.natural_frequency_std_hz,
                    .damping_std = submodel.damping_ratio_std,
                    .truth = std::nullopt});
  }
  return rows;
}

double place(const ModeRow& row) {
  return row.frequency_hz ? *row.frequency_hz : row.truth->natural_frequency_hz;
}

}  // namespace

std::optional<double> ModeRow::frequency_deviation() const {
  if (!truth) return std::nullopt;
  return deviation(frequency_hz, truth->natural_frequency_hz, frequency_std_hz);
}

std::optional<double> ModeRow::damping_deviation() const {
  if (!truth) return std::nullopt;
  return deviation(damping_ratio, truth->damping_ratio, damping_std);
}

std::optional<double> ModeRow::relative_frequency_error() const {
  if (!truth || !frequency_hz) return std::nullopt;
  return std::abs(*frequency_hz / truth->natural_frequency_hz - 1.0);
}

std::vector<ModeRow> mode_table(const AdditiveModel& model, std::span<const TrueMode> truth) {
  std::vector<ModeRow> rows = identified(model);
  std::vector<double> true_hz;
  for (const TrueMode& mode : truth) true_hz.push_back(mode.natural_frequency_hz);
  std::vector<double> estimated_hz;
  for (const ModeRow& row : rows) estimated_hz.push_back(*row.frequency_hz);
  const auto partner = pair_with_truth(true_hz, estimated_hz);
  for (std::size_t t = 0; t < partner.size(); ++t)
    (partner[t] ? rows[*partner[t]] : rows.emplace_back()).truth = truth[t];
  std::ranges::stable_sort(rows, {}, place);
  return rows;
}

}  // namespace stageid
