#include "tools/dashboard/dashboard.hpp"

#include <fmt/format.h>

#include <cmath>
#include <thread>

#include "acquisition/files/json_text.hpp"
#include "tools/report/html_page.hpp"
#include "tools/report/timing_json.hpp"
#include "tools/terminal/interrupt.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

namespace {

constexpr std::size_t kEventsShown = 60;
// A page that is loaded again has no stream for a moment.
constexpr std::chrono::seconds kReload{2};

/// Limits of a group; null if there are none.
SortedJson limits(const Eigen::VectorXd& values, std::size_t channels) {
  SortedJson out = SortedJson::array();
  for (std::size_t i = 0; i < channels; ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    const bool known = index < values.size() && std::isfinite(values[index]);
    out.push_back(known ? SortedJson(values[index]) : SortedJson());
  }
  return out;
}

SortedJson channels(const std::vector<Channel>& list) {
  SortedJson out = SortedJson::array();
  for (const Channel& channel : list)
    out.push_back({{"name", channel.name}, {"unit", channel.unit}});
  return out;
}

bool same_run(const LogRun& ended, const RunId& run) {
  return ended.realization == run.realization && ended.experiment == run.experiment;
}

/// Total counts of the completed runs and the current one.
void add_counts(const LiveLevels::Ended& ended, const ExperimentProgress& progress,
                SortedJson& json) {
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
SortedJson plant_json(const PlantSnapshot& plant) {
  SortedJson values = SortedJson::array();
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
  SortedJson json = {
      {"stage", stage.name},
      {"backend", stage.backend},
      {"experiment", config.file.filename().string()},
      {"sample_rate_hz", stage.sample_rate_hz},
      {"period_s", wall ? SortedJson(1.0 / (stage.sample_rate_hz * stage.pace)) : SortedJson()},
      {"realizations", plan.spec().realizations},
      {"actuators", channels(stage.actuators)},
      {"sensors", channels(stage.sensors)},
      {"limits",
       {{"actuator_n", limits(bounds.actuator_n, stage.actuators.size())},
        {"thermal_rms_n", limits(bounds.thermal_rms_n, stage.actuators.size())},
        {"position_window_m", limits(bounds.position_window_m, stage.sensors.size())}}}};
  return script_safe(in_ascii(json));
}

}  // namespace

Dashboard::Dashboard(const DashboardAddress& address, const ExperimentConfig& config,
                     const ExperimentPlan& plan, const StageInfo& stage,
                     const std::filesystem::path& log, int runs_before,
                     std::optional<double> wanted_variance)
    : runs_before_(runs_before),
      wanted_variance_(wanted_variance),
      levels_(static_cast<Eigen::Index>(stage.actuators.size() + stage.sensors.size())),
      traces_(static_cast<Eigen::Index>(stage.actuators.size() + stage.sensors.size()),
              stage.sample_rate_hz),
      response_(log, config.frf, content_.response) {
  progress_.runs_total = static_cast<int>(plan.runs().size()) - runs_before;
  content_.page = html_page(HtmlPage::dashboard,
                            fmt::format("{}: {}", stage.name, config.file.filename().string()),
                            dashboard_content_json(config, plan, stage));
  content_.abort = [this] {
    aborted_ = true;
    request_interrupt();
    if (EventLog* const events = events_)
      events->write("abort", {{"from", std::string("dashboard")}});
  };
  content_.history = [this] {
    const StageWatch* const watch = watch_;
    return watch != nullptr ? watch->history_json() : "{}";
  };
  content_.trace = [this](int channel) { return traces_.json(channel); };
  content_.watched = [this] { response_.watch(); };
  shown_levels_ = levels_.take();
  publish();
  server_ = std::make_unique<DashboardServer>(address, content_);
}

/// Mean relative variance so far, and the one at which the measurement ends; null: unknown.
SortedJson Dashboard::accuracy_json() const {
  const std::optional<LiveAccuracy> reached = response_.accuracy();
  if (!reached) return {};
  return {{"variance", reached->variance},
          {"realizations", reached->realizations},
          {"wanted", or_null(wanted_variance_)}};
}

/// What changes during a measurement, for the script of the page: one line.
std::string Dashboard::state_json() const {
  const ExperimentProgress& p = progress_;
  const StageWatch* const watch = watch_;
  const double rate = wall_s_ > 0.0 ? p.seconds_done / wall_s_ : 0.0;
  SortedJson json = {
      {"state", state_},
      {"node_state", to_string(p.node_state)},
      {"run", {{"realization", p.run.realization}, {"experiment", p.run.experiment}}},
      {"runs_done", p.runs_done + runs_before_},
      {"runs_total", p.runs_total + runs_before_},
      {"seconds_done", p.seconds_done},
      {"seconds_total", p.seconds_total},
      {"seconds_left",
       rate > 0.0 ? SortedJson((p.seconds_total - p.seconds_done) / rate) : SortedJson()},
      {"speed", rate},
      {"levels",
       {{"peak", shown_levels_.peak},
        {"rms", shown_levels_.rms},
        {"largest_peak", shown_levels_.largest_peak}}},
      {"response", {{"edition", content_.response.get().number}, {"status", response_.status()}}},
      {"accuracy", accuracy_json()},
      {"supervisor", plant_ ? plant_json(plant_()) : SortedJson()},
      {"watch", watch != nullptr ? SortedJson(watch->state()) : SortedJson()},
      {"watchers", server_ ? server_->watchers() : 0},
      {"message", message_},
      {"exit_code", or_null(exit_code_)},
      {"stays", stays_}};
  add_counts(levels_.ended(), p, json);
  json["events"] = SortedJson::array();
  if (const EventLog* const log = events_)
    for (const std::string& event : log->latest(kEventsShown))
      json["events"].push_back(parse_json<SortedJson>(event));
  return in_ascii(json);
}

void Dashboard::publish() { content_.state.publish(state_json()); }

const std::string& Dashboard::url() const noexcept { return server_->url(); }

std::vector<RunObserver*> Dashboard::observers() noexcept {
  return {&levels_, &traces_, &response_};
}

void Dashboard::watch(std::shared_ptr<EventLog> events) noexcept {
  shared_events_ = std::move(events);
  events_ = shared_events_.get();
  start_ = SteadyClock::now();
}

void Dashboard::watch(std::function<PlantSnapshot()> snapshot) { plant_ = std::move(snapshot); }

void Dashboard::watch(std::shared_ptr<StageWatch> watch) noexcept {
  shared_watch_ = std::move(watch);
  shared_watch_->show();
  watch_ = shared_watch_.get();
}

void Dashboard::update(const ExperimentProgress& progress) {
  state_ = aborted_ ? "stopping" : "running";
  progress_ = progress;
  wall_s_ = std::chrono::duration<double>(SteadyClock::now() - start_).count();
  if (Levels fresh = levels_.take(); fresh.rows > 0) shown_levels_ = std::move(fresh);
  publish();
}

void Dashboard::finish(int exit_code, const std::string& message) {
  if (server_->watchers() > 0) {
    state_ = "estimating";
    publish();
    response_.catch_up();
  }
  state_ = "ended";
  exit_code_ = exit_code;
  message_ = message;
  stays_ = aborted_ || !interrupt_flag();  // who sends a signal waits for the end of the program
  publish();
  if (!stays_) server_->finish(std::chrono::seconds(kFarewell_s));
  events_ = nullptr;
  plant_ = {};
}

void Dashboard::stay(const Console& console) {
  if (!stays_ || server_->watchers() == 0) return;
  console.warning("dashboard: shows the end until its pages are closed; Ctrl-C also closes it");
  const ControlledStop stop;
  if (aborted_) forget_interrupt();
  auto seen = SteadyClock::now();
  while (!interrupt_flag() && SteadyClock::now() - seen < kReload) {
    if (server_->watchers() > 0) seen = SteadyClock::now();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace stageid
