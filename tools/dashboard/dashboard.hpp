#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/record/event_log.hpp"
#include "hal/stage/supervisor.hpp"
#include "tools/dashboard/dashboard_server.hpp"
#include "tools/dashboard/live_levels.hpp"
#include "tools/dashboard/live_response.hpp"
#include "tools/dashboard/live_traces.hpp"
#include "tools/experiment/experiment_config.hpp"
#include "tools/terminal/console.hpp"
#include "tools/terminal/json.hpp"
#include "tools/watch/stage_watch.hpp"

namespace stageid {

/// Shows an experiment in a browser while it is measured: progress, accuracy, levels against limits, traces, states,
/// misses, timing, response and CMIF, and a button that stops it as Ctrl-C does.
///
/// It reads samples only after they were logged (RunObserver), and the counts of the loop only through
/// ExperimentProgress. The loop never waits for watchers.
class Dashboard {
 public:
  /// Starts to listen and serve. @throws StageError, std::invalid_argument as DashboardServer.
  Dashboard(const DashboardAddress& address, const ExperimentConfig& config,
            const ExperimentPlan& plan, const StageInfo& stage, const std::filesystem::path& log,
            int runs_before, std::optional<double> wanted_variance);
  Dashboard(Dashboard&&) = delete;

  const std::string& url() const noexcept;
  /// Observers of the rows of the log. Valid during the lifetime of *this.
  std::vector<RunObserver*> observers() noexcept;
  /// Shows the newest events of `events`, and records an abort there.
  void watch(std::shared_ptr<EventLog> events) noexcept;
  /// Shows the state of the plant around the stage; `snapshot` may be called until the end of finish().
  void watch(std::function<PlantSnapshot()> snapshot);
  /// Shows what a watch of the stage tracks and finds; `watch` has not begun.
  void watch(std::shared_ptr<StageWatch> watch) noexcept;

  /// Must be called a few times per second, from one thread.
  void update(const ExperimentProgress& progress);
  /// Ends the experiment. Watchers receive the last state and the last response. After a signal, returns when they
  /// have left, or after kFarewell_s.
  void finish(int exit_code, const std::string& message);
  /// Shows the end until every page is closed, or a signal. Returns at once without pages, and if a signal ended the
  /// experiment.
  void stay(const Console& console);

  static constexpr int kFarewell_s = 10;  ///< a page may be busy drawing

 private:
  using SteadyClock = std::chrono::steady_clock;
  void publish();
  std::string state_json() const;
  SortedJson accuracy_json() const;

  DashboardContent content_;
  const char* state_ = "starting";  ///< starting, running, stopping, estimating, ended
  ExperimentProgress progress_;
  int runs_before_;                        ///< already complete in the log
  std::optional<double> wanted_variance_;  ///< of --until
  SteadyClock::time_point start_ = SteadyClock::now();
  double wall_s_ = 0.0;  ///< since the first cycle
  Levels shown_levels_;
  std::optional<int> exit_code_;  ///< set at the end
  std::string message_;
  bool stays_ = false;  ///< after the end
  std::function<PlantSnapshot()> plant_;
  std::shared_ptr<StageWatch> shared_watch_;
  std::shared_ptr<EventLog> shared_events_;
  // What was shared, for the threads of the server.
  std::atomic<const StageWatch*> watch_ = nullptr;
  std::atomic<EventLog*> events_ = nullptr;
  std::atomic<bool> aborted_ = false;
  LiveLevels levels_;
  LiveTraces traces_;
  LiveResponse response_;
  std::unique_ptr<DashboardServer> server_;  // last: its threads use all other members
};

}  // namespace stageid
