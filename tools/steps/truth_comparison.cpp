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

using Json = nlohmann::ordered_json;

/// Largest relative frequency difference of two modes that are considered the same.
constexpr double kFarthest = 0.05;

std::vector<const Submodel*> modes_of(const AdditiveModel& model) {
  std::vector<const Submodel*> modes;
  for (const Submodel& s : model.submodels)
    if (s.is_mode()) modes.push_back(&s);
  return modes;
}

void match(const std::vector<const Submodel*>& estimated, const FrfEstimate& frf,
           TruthComparison& out) {
  std::vector<double> true_hz;
  for (const ModeComparison& mode : out.modes) true_hz.push_back(mode.true_frequency_hz);
  std::vector<double> estimated_hz;
  for (const Submodel* s : estimated) estimated_hz.push_back(s->natural_frequency_hz());
  const auto partner = pair_with_truth(true_hz, estimated_hz);
  for (std::size_t t = 0; t < partner.size(); ++t) {
    if (!partner[t]) continue;
    ModeComparison& mode = out.modes[t];
    const Submodel& s = *estimated[*partner[t]];
    mode.found = true;
    mode.frequency_hz = s.natural_frequency_hz();
    mode.damping = s.damping_ratio();
    mode.frequency_std_hz = s.natural_frequency_std_hz.value_or(0.0);
    mode.damping_std = s.damping_ratio_std.value_or(0.0);
  }
  // Modes outside the lines represent the rest of the plant there: suspension, modes above the band.
  const double low_hz = frf.frequency_hz[0];
  const double high_hz = frf.frequency_hz[frf.lines() - 1];
  for (std::size_t e = 0; e < estimated_hz.size(); ++e) {
    const double f = estimated_hz[e];
    if (std::ranges::find(partner, std::optional(e)) == partner.end())
      (f < low_hz || f > high_hz ? out.outside_hz : out.extra_hz).push_back(f);
  }
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

std::string deviation(double value, double std) {
  return std > 0.0 ? fmt::format("{:+.2f}", value) : "-";
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

double ModeComparison::frequency_deviation() const {
  return frequency_std_hz > 0.0 ? (frequency_hz - true_frequency_hz) / frequency_std_hz : 0.0;
}
double ModeComparison::damping_deviation() const {
  return damping_std > 0.0 ? (damping - true_damping) / damping_std : 0.0;
}

TruthComparison compare_with_truth(const AdditiveModel& model, const FrfEstimate& frf,
                                   const StageInfo& info, const PlantSpec& plant) {
  TruthComparison out;
  const double last_hz = frf.frequency_hz[frf.lines() - 1];
  for (const PlantMode& mode :
       flexible_modes_seen(info, plant, frf.inputs.names, frf.outputs.names))
    if (mode.natural_frequency_hz <= last_hz) {
      ModeComparison comparison;
      comparison.true_frequency_hz = mode.natural_frequency_hz;
      comparison.true_damping = mode.damping_ratio;
      out.modes.push_back(comparison);
    }
  match(modes_of(model), frf, out);
  const Eigen::MatrixXcd G = exact_response(frf, info, plant);
  const Eigen::MatrixXcd E = response_like(model, frf) - G;
  out.relative_rms_error =
      relative_rms_error(E.cwiseAbs2().array(), G.cwiseAbs2().array(), responding_channels(frf));
  out.normalized_error = std::sqrt(E.squaredNorm() / G.squaredNorm());
  return out;
}

std::vector<std::string> truth_table(const TruthComparison& comparison) {
  std::vector<std::vector<std::string>> rows = {{"mode", "true/Hz", "estimated/Hz", "error",
                                                 "in std", "true damping", "estimated", "error",
                                                 "in std"}};
  for (const ModeComparison& m : comparison.modes) {
    const std::string number = fmt::format("{}", rows.size());
    const std::string frequency = fmt::format("{:.4f}", m.true_frequency_hz);
    const std::string damping = fmt::format("{:.5f}", m.true_damping);
    if (!m.found) {
      rows.push_back({number, frequency, "not found", "", "", damping, "", "", ""});
      continue;
    }
    rows.push_back({number, frequency, fmt::format("{:.4f}", m.frequency_hz),
                    fmt::format("{:+.1e}", m.frequency_hz / m.true_frequency_hz - 1.0),
                    deviation(m.frequency_deviation(), m.frequency_std_hz), damping,
                    fmt::format("{:.5f}", m.damping),
                    fmt::format("{:+.1e}", m.damping / m.true_damping - 1.0),
                    deviation(m.damping_deviation(), m.damping_std)});
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

nlohmann::ordered_json truth_json(const TruthComparison& comparison) {
  Json modes = Json::array();
  for (const ModeComparison& m : comparison.modes) {
    Json mode = {{"true_frequency_hz", m.true_frequency_hz},
                 {"true_damping_ratio", m.true_damping},
                 {"found", m.found}};
    if (m.found) {
      mode["natural_frequency_hz"] = m.frequency_hz;
      mode["damping_ratio"] = m.damping;
      mode["natural_frequency_std_hz"] = m.frequency_std_hz;
      mode["damping_ratio_std"] = m.damping_std;
      mode["frequency_deviation_in_std"] = m.frequency_deviation();
      mode["damping_deviation_in_std"] = m.damping_deviation();
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
