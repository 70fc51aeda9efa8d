#include "tools/dashboard/dashboard.hpp"

#include <fmt/format.h>

#include <atomic>
#include <chrono>

#include "tools/dashboard/dashboard_json.hpp"
#include "tools/dashboard/dashboard_server.hpp"
#include "tools/dashboard/live_levels.hpp"
#include "tools/dashboard/live_response.hpp"
#include "tools/report/html_text.hpp"
#include "tools/report/report_assets.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::size_t kEventsShown = 14;

std::string page_of(const ExperimentConfig& config, const ExperimentPlan& plan,
                    const StageInfo& stage) {
  const std::string content = dashboard_content_json(config, plan, stage);
  return fill_page(
      report::dashboard_html,
      {{"title", escape_html(fmt::format("{}: {}", stage.name, config.file.filename().string()))},
       {"library_css", report::library_css},
       {"css", report::page_css},
       {"dashboard_css", report::dashboard_css},
       {"library_js", report::library_js},
       {"js", report::dashboard_js},
       {"licence", escape_html(report::library_licence)},
       {"content", content}});
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
    shown.levels = levels.take();
    content.state.publish(dashboard_state_json(shown));
    server = std::make_unique<DashboardServer>(address, content);
  }

  void publish() {
    shown.ended = levels.ended();
    shown.response_status = response.status();
    shown.response_edition = content.response.get().number;
    shown.watchers = server->watchers();
    if (plant) shown.plant = plant();
    if (const EventLog* const log = events) shown.events = log->latest(kEventsShown);
    content.state.publish(dashboard_state_json(shown));
  }

  DashboardContent content;
  DashboardState shown;
  std::function<PlantSnapshot()> plant;
  std::atomic<EventLog*> events = nullptr;
  std::atomic<bool> aborted = false;
  SteadyClock::time_point start = SteadyClock::now();
  LiveLevels levels;
  LiveResponse response;
  std::unique_ptr<DashboardServer> server;  // last: its threads use all other members
};

Dashboard::Dashboard(const DashboardAddress& address, const ExperimentConfig& config,
                     const ExperimentPlan& plan, const StageInfo& stage,
                     const std::filesystem::path& log, int runs_before)
    : state_(std::make_unique<State>(address, config, plan, stage, log)) {
  state_->shown.runs_before = runs_before;
  state_->shown.progress.runs_total = static_cast<int>(plan.runs().size()) - runs_before;
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
  s.shown.state = s.aborted ? "stopping" : "running";
  s.shown.progress = progress;
  s.shown.wall_s = std::chrono::duration<double>(SteadyClock::now() - s.start).count();
  if (Levels fresh = s.levels.take(); fresh.rows > 0) s.shown.levels = std::move(fresh);
  s.publish();
}

void Dashboard::finish(int exit_code, const std::string& message) {
  State& s = *state_;
  if (s.server->watchers() > 0) {
    s.shown.state = "estimating";
    s.publish();
    s.response.catch_up();
  }
  s.shown.state = "ended";
  s.shown.exit_code = exit_code;
  s.shown.message = message;
  s.publish();
  s.server->finish(std::chrono::seconds(kFarewell_s));
  s.events = nullptr;
}

}  // namespace stageid
