#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/file_error.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/prediction/closed_loop_prediction.hpp"
#include "acquisition/record/experiment_plan_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/experiment/limited_plan.hpp"
#include "tools/experiment/link_load.hpp"
#include "tools/experiment/loop_check.hpp"
#include "tools/experiment/watch_plan.hpp"
#include "tools/measure/measurement.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

std::string limit_text(const Eigen::VectorXd& limits, std::size_t index) {
  return limits.size() == 0 ? "-" : fmt::format("{:.4g}", limits[index]);
}

Json channel_json(const ChannelPrediction& channel) {
  Json json = {
      {"name", channel.name}, {"unit", channel.unit}, {"rms", channel.rms}, {"peak", channel.peak}};
  if (channel.slew_per_s > 0.0) json["slew_per_s"] = channel.slew_per_s;
  if (channel.thermal_rms > 0.0) json["thermal_rms"] = channel.thermal_rms;
  return json;
}

Json design_json(const ExperimentConfig& config, const ExperimentPlan& plan,
                 const DesignPrediction& prediction) {
  Json json = {{"runs", plan.runs().size()},
               {"duration_s", plan.duration_s()},
               {"log_bytes", expected_log_bytes(plan, config.stage.spec.info)},
               {"lines", plan.grid().size()},
               {"resolution_hz", plan.grid().resolution_hz()},
               {"crest_factors", prediction.crest_factor},
               {"violations", prediction.violations()}};
  for (const LinkLoad& link : link_loads(config.stage))
    json["links"].push_back({{"link", link.link},
                             {"load", link.load},
                             {"cycle_s", link.cycle_s},
                             {"highest_rate_hz", link.most_hz}});
  for (const ChannelPrediction& channel : prediction.actuators)
    json["actuators"].push_back(channel_json(channel));
  for (const ChannelPrediction& channel : prediction.sensors)
    json["sensors"].push_back(channel_json(channel));
  return json;
}

/// stageid design CONFIG -o excitation.h5
struct DesignFlags {
  std::filesystem::path config;
  WatchRequest watch;
  std::filesystem::path output;
  double accuracy = 0.0;
  bool force = false;
};

std::vector<std::string> design_table(const ExperimentConfig& config, const ExperimentPlan& plan,
                                      const DesignPrediction& prediction) {
  const StageSpec& stage = config.stage.spec;
  const Eigen::VectorXd frequency_hz = plan.grid().frequency_hz();
  std::vector<std::string> lines;
  const auto [least, most] = std::ranges::minmax_element(prediction.crest_factor);
  lines.push_back(fmt::format("{} of {} + {} of {} s, {:.1f} min in total; log {:.1f} MB",
                              counted(plan.runs().size(), "run"), plan.spec().transient_periods,
                              counted(plan.spec().periods, "period"), plan.grid().period_s(),
                              plan.duration_s() / 60.0,
                              expected_log_bytes(plan, stage.info) / 1e6));
  lines.push_back(fmt::format("{}, {} ... {} Hz; crest factors {:.2f} ... {:.2f}",
                              counted(plan.grid().size(), "line"), frequency_hz[0],
                              frequency_hz[frequency_hz.size() - 1], *least, *most));
  for (const LinkLoad& link : link_loads(config.stage)) lines.push_back(to_string(link));
  std::vector<std::vector<std::string>> rows = {
      {"channel", "unit", "rms", "peak", "limit", "slew/s", "limit", "thermal rms", "limit", ""}};
  for (std::size_t i = 0; i < prediction.actuators.size(); ++i) {
    const ChannelPrediction& c = prediction.actuators[i];
    rows.push_back({c.name, c.unit, fmt::format("{:.4g}", c.rms), fmt::format("{:.4g}", c.peak),
                    limit_text(stage.limits.actuator_n, i), fmt::format("{:.4g}", c.slew_per_s),
                    limit_text(stage.limits.slew_n_s, i), fmt::format("{:.4g}", c.thermal_rms),
                    limit_text(stage.limits.thermal_rms_n, i),
                    c.violations.empty() ? "" : "EXCEEDED"});
  }
  for (std::size_t i = 0; i < prediction.sensors.size(); ++i) {
    const ChannelPrediction& c = prediction.sensors[i];
    rows.push_back({c.name, c.unit, fmt::format("{:.4g}", c.rms), fmt::format("{:.4g}", c.peak),
                    limit_text(stage.limits.position_window_m, i), "", "", "", "",
                    c.violations.empty() ? "" : "EXCEEDED"});
  }
  for (std::string& line : table_lines(rows)) lines.push_back(std::move(line));
  return lines;
}

void write_limited(const DesignFlags& flags, Console& console, const ExperimentConfig& config,
                   const LimitedPlan& limited) {
  const ExperimentPlan& plan = limited.design.plan;
  write_experiment_plan(flags.output, plan);
  console.result("{}, {:.1f} min in total; {}; prior {}", counted(plan.runs().size(), "run"),
                 plan.duration_s() / 60.0, counted(plan.grid().size(), "line"),
                 config.limits->prior.string());
  for (const LinkLoad& link : link_loads(config.stage)) console.result(to_string(link));
  for (const std::string& line : limited_table(limited, flags.accuracy)) console.result(line);
  console.result("wrote {}", flags.output.string());
  Json json = {{"runs", plan.runs().size()},
               {"duration_s", plan.duration_s()},
               {"log_bytes", expected_log_bytes(plan, config.stage.spec.info)},
               {"lines", plan.grid().size()}};
  json.update(limited_json(limited, flags.accuracy));
  console.result(json);
}

/// stageid design CONFIG --watch model.json --frf frf.h5 -o watch.yaml
void design_watch(const DesignFlags& flags, Console& console, const ExperimentConfig& config) {
  require_ending(flags.output, "an experiment", {".yaml", ".yml"});
  require_writable(flags.output, {flags.config, flags.watch.model, flags.watch.frf});
  require_stable_loop(config, console);
  if (config.stage.spec.controller.by_peer)
    console.warning(
        "the stage closes the loop itself; the effect of its controller on the forces is "
        "neglected");
  const WatchPlan plan = make_watch_plan(config, flags.watch);
  write_text_file(flags.output, watch_experiment_text(plan, config, flags.output));
  const double period_s = config.samples_per_period / config.stage.spec.info.sample_rate_hz;
  std::vector<std::vector<std::string>> rows = {
      {"tracked", "deviation per period", fmt::format("{:.2g} detected after", flags.watch.drift)}};
  Json json = {{"lines", plan.lines}, {"rms", plan.levels}, {"tracked", Json::array()}};
  for (std::size_t i = 0; i < plan.parameters.size(); ++i) {
    const std::string name = describe(plan.parameters[i], plan.model);
    const double deviation = plan.forecast.deviation[i];
    const double detected_s = plan.forecast.periods[i] * period_s;
    const bool delay = plan.parameters[i].kind == TrackedKind::delay;
    rows.push_back({name, fmt::format("{:.2e}{}", deviation, delay ? " s" : ""),
                    std::isfinite(detected_s) ? fmt::format("{:.3g} s", detected_s) : "-"});
    json["tracked"].push_back({{"name", name}, {"deviation", deviation}});
    if (std::isfinite(detected_s)) json["tracked"].back()["detected_s"] = detected_s;
  }
  console.result(
      "{}, {:.6g} ... {:.6g} Hz; the largest deviation of a natural frequency is within {:.1g} % "
      "of the optimum for these phases",
      counted(plan.lines.size(), "line"), plan.lines.front() / period_s,
      plan.lines.back() / period_s, 100.0 * std::expm1(0.5 * plan.gap));
  for (const std::string& line : table_lines(rows)) console.result(line);
  console.result("wrote {}", flags.output.string());
  console.result(json);
}

void design(const DesignFlags& flags, Console& console) {
  const ExperimentConfig config = load_experiment_config(flags.config);
  if (!flags.watch.model.empty()) return design_watch(flags, console, config);
  require_writable(flags.output, {flags.config});
  require_stable_loop(config, console);
  if (config.limits) {
    const LimitedPlan limited = make_limited_plan(config);
    write_limited(flags, console, config, limited);
    return;
  }
  if (flags.accuracy > 0.0)
    throw FormatError(config.file, "",
                      "--accuracy: needs the noise of a prior; set 'level: {limits: {prior: "
                      "FILE}}' in the experiment file");
  const ExperimentPlan plan = make_plan(config);
  const DesignPrediction prediction = predict_signals(config, plan, console);
  const bool written = flags.force || prediction.violations().empty();
  if (written) write_experiment_plan(flags.output, plan);
  for (const std::string& line : design_table(config, plan, prediction)) console.result(line);
  require_within_limits(config, prediction, flags.force, console);
  console.result("wrote {}", flags.output.string());
  console.result(design_json(config, plan, prediction));
}

}  // namespace

void design_command(CLI::App& app, Console& console) {
  auto [command, flags] = add_command(
      app, console, "design",
      "Design the multisines; check the predicted forces and motions against the limits", design);
  add_required(command, "config", flags.config, "experiment file (.yaml)");
  add_required(command, "-o,--output", flags.output,
               "HDF5 file to write; with --watch an experiment file");
  add_value(command, "--accuracy", flags.accuracy, "VARIANCE",
            "print the measuring time for this mean relative variance of the response, e.g. "
            "1e-6 for 0.1 % rms; needs level.limits",
            kPositive);
  CLI::Option* watch = command.add_option(
      "--watch", flags.watch.model,
      "design a permanent excitation that tracks this model.json: an experiment file (.yaml) with "
      "the most informative lines, amplitudes and phases");
  CLI::Option* frf =
      command.add_option("--frf", flags.watch.frf, "frf.h5 with the noise, for --watch");
  watch->needs(frf);
  watch->excludes("--accuracy");
  frf->needs(watch);
  command
      .add_option_function<double>(
          "--rms-nm", [&rms_m = flags.watch.rms_m](double rms_nm) { rms_m = 1e-9 * rms_nm; },
          "with --watch: largest rms of a sensor in nm; omitted: the levels of the experiment")
      ->check(CLI::Range(1e-6, 1e9))
      ->needs(watch);
  command
      .add_option("--drift", flags.watch.drift,
                  "with --watch: relative drift of a natural frequency, to predict its detection")
      ->check(CLI::Range(1e-12, 1.0))
      ->needs(watch)
      ->capture_default_str();
  command.add_flag("--force", flags.force, "write even if a limit would be exceeded");
}

}  // namespace stageid
