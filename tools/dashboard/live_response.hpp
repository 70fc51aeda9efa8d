#pragma once

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>

#include "acquisition/loop/run_observer.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tools/dashboard/latest_text.hpp"

namespace stageid {

class LogReader;

/// Complete realizations of a log: those with as many different complete experiments as any has.
int complete_realizations(const LogReader& log);

/// The frequency response and its CMIF while they form: estimated by estimate_plant_frf(), as
/// `stageid frf` does, from the log that is being written, whenever one more realization is complete
/// in it. A thread of its own of the lowest priority; nothing is computed while nobody watches.
class LiveResponse final : public RunObserver {
 public:
  /// Publishes to `response`: {"realizations", "content", "blocks"} as the report page holds them.
  LiveResponse(std::filesystem::path log, FrfOptions options, LatestText& response);
  ~LiveResponse() override;
  LiveResponse(const LiveResponse&) = delete;
  LiveResponse& operator=(const LiveResponse&) = delete;

  void begin_run(const LogRun&) noexcept override {}
  void rows(std::span<const double>) noexcept override {}
  void end_run(const LogRun& run) noexcept override;

  /// From now on somebody watches.
  void watch();
  /// Waits until what is complete in the log is shown, if anybody watches.
  void catch_up();
  /// One line for people: what is shown, or why nothing is.
  std::string status() const;

 private:
  void run();
  void update();
  void set_status(std::string status);
  bool due() const { return watched_ && asked_ != done_; }

  std::filesystem::path log_;
  FrfOptions options_;
  LatestText& response_;
  mutable std::mutex mutex_;  // of all below but the last two
  std::condition_variable changed_;
  bool watched_ = false;
  int asked_ = 1;  ///< runs complete so far, and one for what is there from the start
  int done_ = 0;
  std::string status_ = "waiting for the first complete realization";
  std::atomic<bool> stop_ = false;
  int realizations_ = 0;  // the thread's own: shown
  std::thread thread_;
};

}  // namespace stageid
