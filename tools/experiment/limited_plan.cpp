#include "tools/experiment/limited_plan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <stdexcept>

#include "acquisition/files/fail.hpp"
#include "acquisition/prediction/closed_loop_prediction.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/plant_prior_file.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {
namespace {

constexpr double kDoubtfulMisfit = 0.05;

std::string limit_text(double limit) {
  return std::isinf(limit) ? "-" : fmt::format("{:.4g}", limit);
}

double realization_s(const ExperimentPlan& plan) {
  return plan.duration_s() / plan.spec().realizations;
}

/// Mean relative variance after all runs of the plan.
double final_variance(const LimitedPlan& limited) {
  const ExperimentPlan& plan = limited.design.plan;
  return relative_variance(plan, limited.loop.cost) /
         (static_cast<double>(plan.spec().realizations) * plan.spec().periods);
}

/// Duration in s of as many whole realizations of the plan as reach a mean relative variance.
double duration_to_reach_s(const LimitedPlan& limited, double variance) {
  if (!(variance > 0.0) || !std::isfinite(variance))
    fail_request("accuracy: {} is not a variance; write a positive number, e.g. 1e-6 for 0.1 %",
                 variance);
  const ExperimentPlan& plan = limited.design.plan;
  const double one = relative_variance(plan, limited.loop.cost) / plan.spec().periods;
  return std::ceil(one / variance) * realization_s(plan);
}

}  // namespace

LimitedPlan make_limited_plan(const ExperimentConfig& config) {
  const LimitRequest& request = config.limits.value();
  const ExperimentPlan outline = outline_plan(config);
  const StageSpec& stage = config.stage.spec;
  if (stage.controller.by_peer)
    throw FormatError(config.file, "",
                      "level.limits: " + why_unpredictable(stage, config.stage.plant) +
                          ", so its signals cannot be predicted; use rms_n or peak_n");
  const PlantPrior prior = read_plant_prior(
      request.prior, stage.info, outline.grid().frequency_hz(), below_band_hz(outline.grid()));
  Eigen::VectorXd velocity_m_s;
  if (request.velocity_m_s > 0.0)
    velocity_m_s.setConstant(stage.info.sensors.size(), request.velocity_m_s);
  for (Eigen::Index i = 0; i < velocity_m_s.size(); ++i)
    if (is_acceleration(stage.info.sensors[i])) velocity_m_s[i] = kUnlimited;
  try {
    BoundedLoop loop = bounded_loop(outline.grid(), config.experiment, stage, prior,
                                    config.frf.outputs, velocity_m_s);
    LimitedDesign design = design_within_limits(
        outline.grid(), {config.experiment, loop.cost, loop.signals, request.safety});
    return {std::move(design), std::move(loop)};
  } catch (const std::invalid_argument& error) {
    fail_format(config.file, "", "level.limits from {}: {}", request.prior.string(), error.what());
  }
}

std::vector<std::string> limited_table(const LimitedPlan& limited, double accuracy) {
  std::vector<std::vector<std::string>> rows = {
      {"channel", "of", "unit", "peak", "from rest", "noise", "limit", "rms", "limit", "used"}};
  for (std::size_t s = 0; s < limited.loop.signals.size(); ++s) {
    const BoundedSignal& signal = limited.loop.signals[s];
    const SignalPeak& peak = limited.design.peaks[s];
    rows.push_back({signal.name, to_string(signal.kind), limited.loop.units[s],
                    fmt::format("{:.4g}", peak.steady), fmt::format("{:.4g}", peak.from_rest),
                    fmt::format("{:.2g}", signal.reserve), limit_text(signal.peak_limit),
                    fmt::format("{:.4g}", peak.rms), limit_text(signal.rms_limit),
                    fmt::format("{:.1f} %", 100.0 * limit_use(signal, peak))});
  }
  std::vector<std::string> lines = table_lines(rows);
  if (!limited.loop.unknown.empty())
    lines.push_back(fmt::format("not predicted, because the prior does not contain them: {}",
                                fmt::join(limited.loop.unknown, ", ")));
  if (limited.loop.extrapolation_misfit > kDoubtfulMisfit)
    lines.push_back(
        fmt::format("the peak from rest is uncertain: the prior has no data below {:.4g} Hz, and "
                    "its lowest lines do not match a rigid body (misfit {:.0f} %); measure a pilot "
                    "from a lower frequency on",
                    limited.loop.extrapolated_below_hz, 100.0 * limited.loop.extrapolation_misfit));
  if (!limited.loop.noise_known) {
    lines.push_back("the prior has no noise estimate, so accuracy cannot be predicted");
    return lines;
  }
  const double variance = final_variance(limited);
  lines.push_back(fmt::format("expected after all runs: mean relative variance {:.3g} ({:.3g} %)",
                              variance, 100.0 * std::sqrt(variance)));
  if (accuracy > 0.0)
    lines.push_back(fmt::format("a variance of {:.3g} ({:.3g} %) is reached after {:.1f} min",
                                accuracy, 100.0 * std::sqrt(accuracy),
                                duration_to_reach_s(limited, accuracy) / 60.0));
  return lines;
}

Json limited_json(const LimitedPlan& limited, double accuracy) {
  Json json = {{"signals", Json::array()}, {"not_predicted", limited.loop.unknown}};
  for (std::size_t s = 0; s < limited.loop.signals.size(); ++s) {
    const BoundedSignal& signal = limited.loop.signals[s];
    const SignalPeak& peak = limited.design.peaks[s];
    Json entry = {
        {"name", signal.name}, {"of", to_string(signal.kind)},     {"unit", limited.loop.units[s]},
        {"peak", peak.steady}, {"peak_from_rest", peak.from_rest}, {"reserve", signal.reserve},
        {"rms", peak.rms},     {"used", limit_use(signal, peak)}};
    if (std::isfinite(signal.peak_limit)) entry["peak_limit"] = signal.peak_limit;
    if (std::isfinite(signal.rms_limit)) entry["rms_limit"] = signal.rms_limit;
    json["signals"].push_back(std::move(entry));
  }
  if (limited.loop.extrapolated_below_hz > 0.0)
    json["extrapolated"] = {{"below_hz", limited.loop.extrapolated_below_hz},
                            {"misfit", limited.loop.extrapolation_misfit}};
  if (!limited.loop.noise_known) return json;
  json["relative_variance"] = final_variance(limited);
  if (accuracy > 0.0) {
    json["accuracy"] = accuracy;
    json["seconds_to_accuracy"] = duration_to_reach_s(limited, accuracy);
  }
  return json;
}

}  // namespace stageid
