#include "tools/dashboard/dashboard.hpp"

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "acquisition/files/json_text.hpp"
#include "tools/dashboard/dashboard_server.hpp"
#include "tools/dashboard/live_levels.hpp"
#include "tools/dashboard/live_response.hpp"
#include "tools/report/html_page.hpp"
#include "tools/report/report_assets.hpp"
#include "tools/report/timing_json.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {

namespace {

using Json = nlohmann::json;
using SteadyClock = std::chrono::steady_clock;

constexpr std::size_t kEventsShown = 14;

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
void add_counts(const LiveLevels::Ended& ended, const ExperimentProgress& progress, Json& json) {
  RunHealth health = ended.health;
  RunTiming timing = ended.timing;
  if (ended.runs == 0 || !same_run(ended.last, progress.run)) {
    health += progress.health;
    timing += progress.timing;
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

/// Constant content: names, units, limits, periods. Safe inside <script>.
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

std::string page_of(const ExperimentConfig& config, const ExperimentPlan& plan,
                    const StageInfo& stage) {
  return html_page({.title = fmt::format("{}: {}", stage.name, config.file.filename().string()),
                    .object = "stageidDashboard",
                    .policy = "; connect-src 'self'; base-uri 'none'; form-action 'none'",
                    .without_script =
                        "The dashboard needs JavaScript, which is included in this page; enable "
                        "scripts to see it.",
                    .css = report::dashboard_css,
                    .js = report::dashboard_js,
                    .content = dashboard_content_json(config, plan, stage),
                    .blocks = ""});
}

}  // namespace

struct Dashboard::State {
  State(const DashboardAddress& address, const ExperimentConfig& config, const ExperimentPlan& plan,
        const StageInfo& stage, const std::filesystem::path& log)
      : levels(static_cast<Eigen::Index>(stage.actuators.size() + stage.sensors.size())),
        response(log, config.frf, content.response) {
    content.page = page_of(config, plan, stage);
    content.abort = [this] {
      aborted = true;
      request_interrupt();
      if (EventLog* const log_of_events = events)
        log_of_events->write("abort", {{"from", std::string("dashboard")}});
    };
    content.watched = [this] { response.watch(); };
    shown_levels = levels.take();
    publish();
    server = std::make_unique<DashboardServer>(address, content);
  }

  void publish() { content.state.publish(state_json()); }

  /// What changes during a measurement, for the script of the page: one line.
  std::string state_json() const {
    const ExperimentProgress& p = progress;
    const double rate = wall_s > 0.0 ? p.seconds_done / wall_s : 0.0;
    Json json = {
        {"state", state},
        {"node_state", to_string(p.node_state)},
        {"run", {{"realization", p.run.realization}, {"experiment", p.run.experiment}}},
        {"runs_done", p.runs_done + runs_before},
        {"runs_total", p.runs_total + runs_before},
        {"seconds_done", p.seconds_done},
        {"seconds_total", p.seconds_total},
        {"seconds_left", rate > 0.0 ? Json((p.seconds_total - p.seconds_done) / rate) : Json()},
        {"speed", rate},
        {"levels",
         {{"peak", list(shown_levels.peak)},
          {"rms", list(shown_levels.rms)},
          {"largest_peak", list(shown_levels.largest_peak)}}},
        {"response", {{"edition", content.response.get().number}, {"status", response.status()}}},
        {"supervisor", plant ? plant_json(plant()) : Json()},
        {"watchers", server ? server->watchers() : 0},
        {"message", message},
        {"exit_code", exit_code ? Json(*exit_code) : Json()}};
    add_counts(levels.ended(), p, json);
    json["events"] = Json::array();
    if (const EventLog* const log = events)
      for (const std::string& event : log->latest(kEventsShown))
        json["events"].push_back(parse_json<Json>(event));
    return text_of(json);
  }

  DashboardContent content;
  const char* state = "starting";  ///< starting, running, stopping, estimating, ended
  ExperimentProgress progress;
  int runs_before = 0;  ///< already complete in the log
  SteadyClock::time_point start = SteadyClock::now();
  double wall_s = 0.0;  ///< since the first cycle
  Levels shown_levels;
  std::optional<int> exit_code;  ///< set at the end
  std::string message;
  std::function<PlantSnapshot()> plant;  ///< of the plant around the stage, if there is one
  std::atomic<EventLog*> events = nullptr;
  std::atomic<bool> aborted = false;
  LiveLevels levels;
  LiveResponse response;
  std::unique_ptr<DashboardServer> server;  // last: its threads use all other members
};

Dashboard::Dashboard(const DashboardAddress& address, const ExperimentConfig& config,
                     const ExperimentPlan& plan, const StageInfo& stage,
                     const std::filesystem::path& log, int runs_before)
    : state_(std::make_unique<State>(address, config, plan, stage, log)) {
  state_->runs_before = runs_before;
  state_->progress.runs_total = static_cast<int>(plan.runs().size()) - runs_before;
}

Dashboard::~Dashboard() = default;

const std::string& Dashboard::url() const noexcept { return state_->server->url(); }

std::vector<RunObserver*> Dashboard::observers() noexcept {
  return {&state_->levels, &state_->response};
}

void Dashboard::watch(EventLog& events) noexcept {
  state_->events = &events;
  state_->start = SteadyClock::now();
}

void Dashboard::watch(std::function<PlantSnapshot()> snapshot) {
  state_->plant = std::move(snapshot);
}

void Dashboard::update(const ExperimentProgress& progress) {
  State& s = *state_;
  s.state = s.aborted ? "stopping" : "running";
  s.progress = progress;
  s.wall_s = std::chrono::duration<double>(SteadyClock::now() - s.start).count();
  if (Levels fresh = s.levels.take(); fresh.rows > 0) s.shown_levels = std::move(fresh);
  s.publish();
}

void Dashboard::finish(int exit_code, const std::string& message) {
  State& s = *state_;
  if (s.server->watchers() > 0) {
    s.state = "estimating";
    s.publish();
    s.response.catch_up();
  }
  s.state = "ended";
  s.exit_code = exit_code;
  s.message = message;
  s.publish();
  s.server->finish(std::chrono::seconds(kFarewell_s));
  s.events = nullptr;
}

}  // namespace stageid
