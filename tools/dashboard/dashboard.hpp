#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/record/event_log.hpp"
#include "hal/stage/supervisor.hpp"
#include "tools/dashboard/dashboard_address.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid {

/// Shows an experiment in a browser while it is measured: progress, levels against limits, states,
/// misses, timing, response and CMIF, and a button that stops it as Ctrl-C does.
///
/// It reads samples only after they were logged (RunObserver), and the counts of the loop only through
/// ExperimentProgress. The loop never waits for watchers.
class Dashboard {
 public:
  /// Starts to listen and serve. @throws StageError, std::invalid_argument as DashboardServer.
  Dashboard(const DashboardAddress& address, const ExperimentConfig& config,
            const ExperimentPlan& plan, const StageInfo& stage, const std::filesystem::path& log,
            int runs_before);
  ~Dashboard();

  const std::string& url() const noexcept;
  /// Observers of the rows of the log. Valid during the lifetime of *this.
  std::vector<RunObserver*> observers() noexcept;
  /// Shows the newest events of `events`, and records an abort there.
  void watch(EventLog& events) noexcept;
  /// Shows the state of the plant around the stage; `snapshot` may be called during the lifetime of *this.
  void watch(std::function<PlantSnapshot()> snapshot);

  /// Must be called a few times per second, from one thread.
  void update(const ExperimentProgress& progress);
  /// Ends the experiment. Watchers receive the last state and the last response; returns when they have left, or after
  /// kFarewell_s.
  void finish(int exit_code, const std::string& message);

  static constexpr int kFarewell_s = 10;  ///< a page may be busy drawing

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stageid
