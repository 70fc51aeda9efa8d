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
/// It sees samples only behind the log (RunObserver) and the loop's own counts only through
/// ExperimentProgress: whatever watchers do, the loop does not wait for it.
class Dashboard {
 public:
  /// Listens and serves from now on. @throws StageError, std::invalid_argument as DashboardServer.
  Dashboard(const DashboardAddress& address, const ExperimentConfig& config,
            const ExperimentPlan& plan, const StageInfo& stage, const std::filesystem::path& log,
            int runs_before);
  ~Dashboard();

  const std::string& url() const noexcept;
  /// To be told of the log's rows. Valid while *this lives.
  std::vector<RunObserver*> observers() noexcept;
  /// Shows the newest events of it from now on, and books an abort there.
  void watch(EventLog& events) noexcept;
  /// Shows what stands around the stage; `snapshot` may be called while *this lives.
  void watch(std::function<PlantSnapshot()> snapshot);

  /// A few times a second, from one thread.
  void update(const ExperimentProgress& progress);
  /// The experiment has ended. Watchers get the last state and the last response; returns when they
  /// have left, or after kFarewell_s.
  void finish(int exit_code, const std::string& message);

  static constexpr int kFarewell_s = 10;  ///< a page may be busy drawing

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stageid
