#include "tools/report/report_modes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

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
  std::ranges::sort(rows, {}, [](const ModeRow& row) { return *row.frequency_hz; });
  return rows;
}

constexpr double kFurthest = 0.02;  // relative, of two modes that may be the same

/// Index of the true mode per row, if there is one. Pairs never cross: by dynamic programming, as for the alignment of
/// two sequences. An unpaired mode costs kFurthest, so every closer pair is preferred.
std::vector<std::optional<std::size_t>> partners(const std::vector<ModeRow>& rows,
                                                 const std::vector<TrueMode>& truth) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const auto pair = [&](std::size_t i, std::size_t j) {
    const double f = truth[j].natural_frequency_hz;
    const double apart = std::abs(*rows[i].frequency_hz - f) / f;
    return apart <= kFurthest ? apart : kNever;
  };
  // Least cost of the modes from row i and true mode j on.
  std::vector cost(rows.size() + 1, std::vector<double>(truth.size() + 1, 0.0));
  for (std::size_t i = rows.size() + 1; i-- > 0;)
    for (std::size_t j = truth.size() + 1; j-- > 0;) {
      const bool row = i < rows.size();
      const bool column = j < truth.size();
      double least = row || column ? kNever : 0.0;
      if (row) least = std::min(least, kFurthest + cost[i + 1][j]);
      if (column) least = std::min(least, kFurthest + cost[i][j + 1]);
      if (row && column) least = std::min(least, pair(i, j) + cost[i + 1][j + 1]);
      cost[i][j] = least;
    }

  std::vector<std::optional<std::size_t>> partner(rows.size());
  for (std::size_t i = 0, j = 0; i < rows.size() && j < truth.size();) {
    if (cost[i][j] == pair(i, j) + cost[i + 1][j + 1])
      partner[i++] = j++;
    else if (cost[i][j] == kFurthest + cost[i + 1][j])
      ++i;
    else
      ++j;
  }
  return partner;
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
  std::vector<TrueMode> known(truth.begin(), truth.end());
  std::ranges::sort(known, {}, &TrueMode::natural_frequency_hz);
  std::vector<ModeRow> rows = identified(model);
  const auto partner = partners(rows, known);
  std::vector<bool> found(known.size(), false);
  for (std::size_t i = 0; i < partner.size(); ++i) {
    if (!partner[i]) continue;
    rows[i].truth = known[*partner[i]];
    found[*partner[i]] = true;
  }
  for (std::size_t j = 0; j < known.size(); ++j)
    if (!found[j]) rows.emplace_back().truth = known[j];
  std::ranges::stable_sort(rows, {}, place);
  return rows;
}

}  // namespace stageid
