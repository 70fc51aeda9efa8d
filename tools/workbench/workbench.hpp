#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "tools/config/stage_config.hpp"
#include "tools/dashboard/dashboard_server.hpp"
#include "tools/terminal/json.hpp"
#include "tools/workbench/edit.hpp"
#include "tools/workbench/fit_history.hpp"
#include "tools/workbench/workbench_page.hpp"

namespace stageid {

struct WorkbenchOptions {
  std::vector<std::filesystem::path> inputs;   ///< as of a report, with an FRF
  std::vector<std::filesystem::path> compare;  ///< results to compare with, one per entry
  bool write = false;                          ///< whether models may be saved
  std::filesystem::path directory;             ///< for saved models; empty: that of the FRF
  std::filesystem::path stage;                 ///< whose controller closes the loop; empty: unknown
  int port = 0;                                ///< on loopback; 0: any free one
  int threads = 0;                             ///< of a fit
};

/// A page in the browser that edits a fit: modes, band and options, with undo and redo. Each edit is answered by previews,
/// see warm_start.hpp, the first of them with the action, then by the fit that `stageid fit` would make, with the command
/// line for it, then by its 95 % band and the loop with a controller. Files are written by the action "save" only.
///
/// Actions, POST /act, JSON: those of edited(); {"kind": "undo"}, "redo", {"kind": "go", "index"}; {"kind": "save",
/// "name"}; {"kind": "keep"}: compare with the current model from now on; {"kind": "compare", "index"}: show the curves of
/// that result, null: none. POST /abort stops a running fit. The state of the stream is described by state_json().
class Workbench {
 public:
  static constexpr std::size_t kMostCompared = 100;

  /// Reads the files, begins to serve, and fits in its own thread.
  /// @throws as read_report_data() and DashboardServer; std::invalid_argument if there is no FRF
  explicit Workbench(const WorkbenchOptions& options);
  ~Workbench();
  Workbench(Workbench&&) = delete;

  const std::string& url() const noexcept { return server_->url(); }
  /// Tells the pages that the program ends, and stops to serve. A running fit is not waited for. From any thread, once.
  void end();
  /// What POST /act does. From any thread.
  ActionReply act(const std::string& body);
  /// What the stream tells: {"state": ready | fitting | ended, "index", "states": [{what, stage, modes, cost, saved}],
  /// "command", "cost", "message", "controls", "writable", "directory", "compared": titles, "chosen",
  /// "edition": number of the newest results}.
  std::string state_json() const;

 private:
  /// A fit that the thread makes, and the results so far.
  struct Work {
    std::uint64_t version = 0;
    FitState state;
  };

  ActionReply act_locked(const SortedJson& action);
  ActionReply save(const std::string& name);
  ActionReply keep();
  ActionReply choose(const SortedJson& action);
  FitRequest editable() const;
  FitSetup setup_of(FitRequest request) const;
  FitState begun(Edit edit) const;
  std::string command() const;
  std::string state_text() const;
  void show();
  void change();
  void run();
  bool next(Work& work);
  void improve(const FitSetup& setup, Work& work, const std::function<bool()>& is_over);
  void fit(Work& work);
  void detail(const FitSetup& setup, const Work& work, FitResult result);
  const StageConfig* stage() const noexcept { return stage_ ? &*stage_ : nullptr; }
  void store(const Work& work);
  void fail(Work& work, const std::string& why);
  void tell_progress(const Work& work, double cost);

  WorkbenchOptions options_;
  std::optional<StageConfig> stage_;
  ReportInput input_;
  WorkbenchPage page_;
  std::string fingerprint_;  ///< of the FRF's file
  DashboardContent content_;

  mutable std::mutex mutex_;  ///< of all below up to the thread
  std::condition_variable wake_;
  FitHistory history_;
  std::vector<std::shared_ptr<const Compared>> compared_;
  std::optional<std::size_t> chosen_;
  bool ending_ = false;
  std::uint64_t edition_ = 0;
  std::atomic<std::uint64_t> version_ =
      1;  ///< of the current state; another one ends a running fit
  std::atomic<std::uint64_t> stopped_ = 0;  ///< the version whose fit the user stopped
  std::chrono::steady_clock::time_point told_{};

  std::thread thread_;
  std::unique_ptr<DashboardServer> server_;  // last: its threads use all other members
};

}  // namespace stageid
