#include "tools/steps/truth_comparison.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "estimation/modal/validation.hpp"
#include "frf/response/responding_channels.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {
namespace {

/// Largest relative frequency difference of two modes that are considered the same.
constexpr double kFarthest = 0.05;

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

/// The exact plant on the lines, channels as in `frf`, as measured in the loop.
Eigen::MatrixXcd exact_response(const FrfEstimate& frf, const StageInfo& info,
                                const PlantSpec& plant) {
  const std::vector<PlantMode> modes = plant_modes(info, plant);
  Eigen::MatrixXcd G(frf.n_outputs() * frf.n_inputs(), frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd whole =
        sampled_response(modes, info.delay_s, info.sample_rate_hz, frf.frequency_hz[k]);
    for (Eigen::Index j = 0; j < frf.n_inputs(); ++j)
      for (Eigen::Index i = 0; i < frf.n_outputs(); ++i)
        G(i + frf.n_outputs() * j, k) = whole(channel_index(info.sensors, frf.outputs.name(i)),
                                              channel_index(info.actuators, frf.inputs.name(j)));
  }
  return G;
}

std::string in_deviations(const std::optional<double>& value) {
  return value ? fmt::format("{:+.2f}", *value) : "-";
}

}  // namespace

std::vector<std::optional<std::size_t>> pair_with_truth(const std::vector<double>& true_hz,
                                                        const std::vector<double>& estimated_hz) {
  struct Pair {
    double distance = 0.0;
    std::size_t truth = 0;
    std::size_t estimate = 0;
  };
  std::vector<Pair> pairs;
  for (std::size_t t = 0; t < true_hz.size(); ++t)
    for (std::size_t e = 0; e < estimated_hz.size(); ++e) {
      const double distance = std::abs(estimated_hz[e] - true_hz[t]) / true_hz[t];
      if (distance < kFarthest) pairs.push_back({distance, t, e});
    }
  std::ranges::stable_sort(pairs, {}, &Pair::distance);
  std::vector<std::optional<std::size_t>> partner(true_hz.size());
  std::vector<bool> taken(estimated_hz.size(), false);
  for (const Pair& pair : pairs) {
    if (partner[pair.truth] || taken[pair.estimate]) continue;
    partner[pair.truth] = pair.estimate;
    taken[pair.estimate] = true;
  }
  return partner;
}

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

std::vector<ModeRow> mode_rows(const AdditiveModel& model, std::span<const TrueMode> truth) {
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

TruthComparison compare_with_truth(const AdditiveModel& model, const FrfEstimate& frf,
                                   const StageInfo& info, const PlantSpec& plant) {
  TruthComparison out;
  const double last_hz = frf.frequency_hz[frf.lines() - 1];
  const double first_hz = frf.frequency_hz[0];
  std::vector<TrueMode> truth;
  for (const PlantMode& mode :
       flexible_modes_seen(info, plant, frf.inputs.names, frf.outputs.names))
    if (mode.natural_frequency_hz <= last_hz)
      truth.push_back({mode.natural_frequency_hz, mode.damping_ratio});
  for (const ModeRow& row : mode_rows(model, truth)) {
    if (row.truth) {
      out.modes.push_back(row);
    } else {
      // Modes outside the lines represent the rest of the plant there: suspension, modes above the band.
      const double f = *row.frequency_hz;
      (f < first_hz || f > last_hz ? out.outside_hz : out.extra_hz).push_back(f);
    }
  }
  const Eigen::MatrixXcd G = exact_response(frf, info, plant);
  const Eigen::MatrixXcd E = response_like(model, frf) - G;
  out.relative_rms_error =
      relative_rms_error(relative_squares(E.cwiseAbs2(), G.cwiseAbs2()), responding_channels(frf));
  out.normalized_error = std::sqrt(E.squaredNorm() / G.squaredNorm());
  return out;
}

std::vector<std::string> truth_table(const TruthComparison& comparison) {
  std::vector<std::vector<std::string>> rows = {{"mode", "true/Hz", "estimated/Hz", "error",
                                                 "in std", "true damping", "estimated", "error",
                                                 "in std"}};
  for (const ModeRow& m : comparison.modes) {
    const std::string number = fmt::format("{}", rows.size());
    const auto [true_hz, true_damping] = *m.truth;
    const std::string frequency = fmt::format("{:.4f}", true_hz);
    const std::string damping = fmt::format("{:.5f}", true_damping);
    if (!m.frequency_hz) {
      rows.push_back({number, frequency, "not found", "", "", damping, "", "", ""});
      continue;
    }
    rows.push_back({number, frequency, fmt::format("{:.4f}", *m.frequency_hz),
                    fmt::format("{:+.1e}", *m.frequency_hz / true_hz - 1.0),
                    in_deviations(m.frequency_deviation()), damping,
                    fmt::format("{:.5f}", *m.damping_ratio),
                    fmt::format("{:+.1e}", *m.damping_ratio / true_damping - 1.0),
                    in_deviations(m.damping_deviation())});
  }
  std::vector<std::string> lines = table_lines(rows);
  for (const double hz : comparison.extra_hz)
    lines.push_back(fmt::format("also estimated, but not a mode of the plant: {:.4f} Hz", hz));
  if (!comparison.outside_hz.empty())
    lines.push_back(fmt::format("outside the band, representing the dynamics there: {:.5g} Hz",
                                fmt::join(comparison.outside_hz, ", ")));
  return lines;
}

std::string truth_error_line(const TruthComparison& comparison) {
  const std::string relative =
      std::isfinite(comparison.relative_rms_error)
          ? fmt::format("{:.3e} (relative, channels that respond), ", comparison.relative_rms_error)
          : "";
  return fmt::format("error of the model against the exact plant: {}{:.3e} (whole response)",
                     relative, comparison.normalized_error);
}

Json truth_json(const TruthComparison& comparison) {
  Json modes = Json::array();
  for (const ModeRow& m : comparison.modes) {
    Json mode = {{"true_frequency_hz", m.truth->natural_frequency_hz},
                 {"true_damping_ratio", m.truth->damping_ratio},
                 {"found", m.frequency_hz.has_value()}};
    if (m.frequency_hz) {
      mode["natural_frequency_hz"] = *m.frequency_hz;
      mode["damping_ratio"] = *m.damping_ratio;
      mode["natural_frequency_std_hz"] = m.frequency_std_hz.value_or(0.0);
      mode["damping_ratio_std"] = m.damping_std.value_or(0.0);
      mode["frequency_deviation_in_std"] = m.frequency_deviation().value_or(0.0);
      mode["damping_deviation_in_std"] = m.damping_deviation().value_or(0.0);
    }
    modes.push_back(std::move(mode));
  }
  return {{"modes", modes},
          {"extra_modes_hz", comparison.extra_hz},
          {"modes_beside_band_hz", comparison.outside_hz},
          {"relative_rms_error", comparison.relative_rms_error},
          {"normalized_error", comparison.normalized_error}};
}

}  // namespace stageid
