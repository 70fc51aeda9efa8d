#pragma once

#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "acquisition/loop/run_observer.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tools/dashboard/latest_text.hpp"

namespace stageid {

class LogReader;

/// Number of complete realizations of a log: those with the largest number of different complete experiments.
int complete_realizations(const LogReader& log);

/// Of a response from the realizations so far.
struct LiveAccuracy {
  double variance = 0.0;  ///< mean relative, see worst_relative_variance()
  int realizations = 0;
};

/// The frequency response and its CMIF during a measurement. Whenever one more realization is complete in the log,
/// they are estimated from it by estimate_plant_frf(), as `stageid frf` does. Uses its own thread of lowest priority,
/// and computes nothing without watchers.
class LiveResponse final : public RunObserver {
 public:
  /// Publishes to `response`: {"realizations", "content", "blocks"} in the format of the report page.
  LiveResponse(std::filesystem::path log, FrfOptions options, LatestText& response);

  void begin_run(const LogRun&) noexcept override {}
  void rows(std::span<const double>, std::size_t) noexcept override {}
  void end_run(const LogRun& run) noexcept override;

  /// To be called when the first watcher connects.
  void watch();
  /// Waits until the complete part of the log is shown, if there are watchers.
  void catch_up();
  /// One line for people: the shown response, or why there is none.
  std::string status() const;
  /// Of the shown response; none as long as its variance is unknown.
  std::optional<LiveAccuracy> accuracy() const;

 private:
  void run(const std::stop_token& stop);
  void update();
  void set_status(std::string status);
  bool due() const { return watched_ && asked_ != done_; }

  std::filesystem::path log_;
  FrfOptions options_;
  LatestText& response_;
  mutable std::mutex mutex_;  // of all below except the last two
  std::condition_variable_any changed_;
  bool watched_ = false;
  int asked_ = 1;  ///< completed runs so far, plus one for those present at the start
  int done_ = 0;
  std::string status_ = "waiting for the first complete realization";
  std::optional<LiveAccuracy> accuracy_;
  int realizations_ = 0;  // shown; only used by the thread itself
  std::jthread thread_;
};

}  // namespace stageid
