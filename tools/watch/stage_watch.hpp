#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "acquisition/record/event_log.hpp"
#include "estimation/model/additive_model.hpp"
#include "estimation/tracking/model_tracker.hpp"
#include "tools/terminal/console.hpp"
#include "tools/terminal/json.hpp"
#include "tools/watch/track_file.hpp"
#include "tools/watch/track_history.hpp"
#include "tools/watch/watch_source.hpp"

namespace stageid {

/// Around which model a stage is watched, and how.
struct WatchOptions {
  std::filesystem::path model;
  std::vector<double> band_hz;  ///< low, high; empty: the band of the fit
  std::string false_alarms = "1/year";
  double memory_s = 0.0;  ///< 0: 100 periods
  int learn = TrackerOptions().learning_periods;
};

/// Watches the stage of a log around its model, also while the log is written. Changes are told on the console as they
/// are found.
class StageWatch {
 public:
  /// Reads the model. @throws FileError, FormatError; std::invalid_argument for a wrong rate of false alarms
  StageWatch(WatchOptions options, const Console& console);
  StageWatch(StageWatch&&) = delete;

  /// Writes watch.h5 too.
  void write_tracks(std::filesystem::path file) { track_file_ = std::move(file); }
  /// Writes the changes there too, except those that its file has already: the same log was watched before.
  /// @param events must outlive run()
  void write_events(EventLog& events);

  /// Returns at the end of the log, or when `go_on` is false. It is asked after each period, with the recorded time in
  /// seconds, and while waiting.
  /// @param follow the log is being written: wait for its first run, then for more until it ends
  /// @throws as WatchSource, ModelTracker and TrackFile
  void run(const std::filesystem::path& log, bool follow, const std::function<bool(double)>& go_on);

  /// Whether the stage itself has changed.
  bool stage_changed() const noexcept { return stage_changed_; }
  /// Why the watch says nothing of the stage: too few periods, or another model would be needed; empty if it does.
  std::string doubt() const;
  /// Changes of all properties as a table; then one line with the counts.
  std::vector<std::string> lines() const;
  std::string summary() const;
  Json json() const;

  /// Keeps state() and history_json() up to date. To be called before run().
  void show() noexcept { shown_ = true; }
  /// For a page that shows the watch, from any thread: the present values; and those since the start, with all changes.
  Json state() const;
  std::string history_json() const;

 private:
  std::array<double, 2> band() const;
  TrackerOptions tracker_options() const;
  void open(const std::filesystem::path& log, bool follow);
  void add(const WatchedPeriod& period);
  void tell(const StageChange& change, const WatchedPeriod& period);
  Json state_of(const TrackedPeriod& tracked) const;

  WatchOptions options_;
  const Console& console_;
  AdditiveModel model_;
  std::filesystem::path track_file_;
  EventLog* events_ = nullptr;
  std::set<std::string> told_before_;
  // Since the log has a run.
  std::optional<WatchSource> source_;
  std::optional<ModelTracker> tracker_;
  std::optional<TrackFile> tracks_;
  double period_s_ = 0.0;
  int periods_ = 0;
  int learned_ = 0;
  bool stage_changed_ = false;
  bool shown_ = false;
  mutable std::mutex mutex_;  // of all below; held for a moment only
  Json state_;
  TrackHistory history_;
  Json changes_ = Json::array();
};

}  // namespace stageid
