#include "tools/dashboard/dashboard_json.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "acquisition/files/json_text.hpp"
#include "tools/report/html_text.hpp"
#include "tools/report/timing_json.hpp"

namespace stageid {
namespace {

using Json = nlohmann::json;

std::string text_of(const Json& json) {
  return json.dump(-1, ' ', true, Json::error_handler_t::replace);
}

std::vector<double> list(const Eigen::ArrayXd& values) { return {values.begin(), values.end()}; }

/// Limits of a group; null if there are none.
Json limits(const Eigen::VectorXd& values, std::size_t channels) {
  Json out = Json::array();
  for (std::size_t i = 0; i < channels; ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    const bool known = index < values.size() && std::isfinite(values[index]);
    out.push_back(known ? Json(values[index]) : Json());
  }
  return out;
}

Json channels(const std::vector<Channel>& list) {
  Json out = Json::array();
  for (const Channel& channel : list)
    out.push_back({{"name", channel.name}, {"unit", channel.unit}});
  return out;
}

bool same_run(const LogRun& ended, const RunId& run) {
  return ended.realization == run.realization && ended.experiment == run.experiment;
}

/// Total counts of the completed runs and the current one.
void add_counts(const DashboardState& s, Json& json) {
  RunHealth health = s.ended.health;
  RunTiming timing = s.ended.timing;
  if (s.ended.runs == 0 || !same_run(s.ended.last, s.progress.run)) {
    health += s.progress.health;
    timing += s.progress.timing;
  }
  json["health"] = {{"cycles", health.cycles},
                    {"late", health.late},
                    {"missing", health.missing},
                    {"marked", health.marked},
                    {"irregular", health.irregular},
                    {"largest_lateness_s", 1e-9 * static_cast<double>(health.largest_lateness_ns)}};
  json["timing"] = timing_json(timing);
}

/// The page shows all values under their names.
Json plant_json(const PlantSnapshot& plant) {
  Json values = Json::array();
  const auto add = [&](const char* name, const std::vector<double>& numbers, const char* unit) {
    for (std::size_t i = 0; i < numbers.size(); ++i)
      values.push_back(
          {{"name", fmt::format("{} {}", name, i + 1)}, {"value", numbers[i]}, {"unit", unit}});
  };
  add("temperature", plant.temperature_k, "K");
  add("gravity compensator", plant.gravity_compensator_n, "N");
  std::string state = to_string(plant.state);
  if (plant.cause != FaultCause::none) state += fmt::format(": {}", to_string(plant.cause));
  if (!plant.interlock_closed) state += ", interlock open";
  return {{"state", state}, {"values", values}};
}

}  // namespace

std::string dashboard_state_json(const DashboardState& s) {
  const ExperimentProgress& p = s.progress;
  const double rate = s.wall_s > 0.0 ? p.seconds_done / s.wall_s : 0.0;
  Json json = {
      {"state", s.state},
      {"node_state", to_string(p.node_state)},
      {"run", {{"realization", p.run.realization}, {"experiment", p.run.experiment}}},
      {"runs_done", p.runs_done + s.runs_before},
      {"runs_total", p.runs_total + s.runs_before},
      {"seconds_done", p.seconds_done},
      {"seconds_total", p.seconds_total},
      {"seconds_left", rate > 0.0 ? Json((p.seconds_total - p.seconds_done) / rate) : Json()},
      {"speed", rate},
      {"levels",
       {{"peak", list(s.levels.peak)},
        {"rms", list(s.levels.rms)},
        {"largest_peak", list(s.levels.largest_peak)}}},
      {"response", {{"edition", s.response_edition}, {"status", s.response_status}}},
      {"supervisor", s.plant ? plant_json(*s.plant) : Json()},
      {"watchers", s.watchers},
      {"message", s.message},
      {"exit_code", s.exit_code ? Json(*s.exit_code) : Json()}};
  add_counts(s, json);
  json["events"] = Json::array();
  for (const std::string& event : s.events) json["events"].push_back(parse_json<Json>(event));
  return text_of(json);
}

std::string dashboard_content_json(const ExperimentConfig& config, const ExperimentPlan& plan,
                                   const StageInfo& stage) {
  const StageLimits& bounds = config.stage.spec.limits;
  const bool wall = stage.clock == Clock::wall;
  Json json = {{"stage", stage.name},
               {"backend", stage.backend},
               {"experiment", config.file.filename().string()},
               {"sample_rate_hz", stage.sample_rate_hz},
               {"period_s", wall ? Json(1.0 / (stage.sample_rate_hz * stage.pace)) : Json()},
               {"realizations", plan.spec().realizations},
               {"actuators", channels(stage.actuators)},
               {"sensors", channels(stage.sensors)},
               {"limits",
                {{"actuator_n", limits(bounds.actuator_n, stage.actuators.size())},
                 {"thermal_rms_n", limits(bounds.thermal_rms_n, stage.actuators.size())},
                 {"position_window_m", limits(bounds.position_window_m, stage.sensors.size())}}}};
  return script_safe(text_of(json));
}

}  // namespace stageid
