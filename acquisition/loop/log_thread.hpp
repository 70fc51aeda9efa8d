#pragma once

#include <Eigen/Core>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "acquisition/loop/run_observer.hpp"
#include "acquisition/loop/sample_ring.hpp"
#include "acquisition/record/log_info.hpp"
#include "acquisition/record/run_writer.hpp"

namespace stageid {

/// The thread that empties the ring into the log, so that the loop never waits for a disk.
///
/// Starts and ends of runs are queued with the row at which they belong: the loop may go on with
/// the next run while the last one is still being written. The log is synchronized once a second
/// and behind every run. When the log fails, rows are thrown away from then on and failed() is
/// true. Observers are told of everything behind the log, of a log that has failed too.
class LogThread {
 public:
  LogThread(RunWriter& log, SampleRing& ring, std::vector<RunObserver*> observers = {});
  /// Writes everything that is queued, then ends.
  ~LogThread();
  LogThread(const LogThread&) = delete;
  LogThread& operator=(const LogThread&) = delete;

  // Called between runs, by the producer's thread; they take a lock.
  void begin_run(LogRun run, Eigen::MatrixXd excitation);
  void end_run(LogRun run);

  /// Waits until everything queued is written and synchronized, or the log has failed.
  void drain();

  bool failed() const noexcept { return failed_.load(std::memory_order_relaxed); }
  /// Complete runs that are in the log wholly.
  int complete_runs() const noexcept { return complete_runs_.load(std::memory_order_relaxed); }
  /// What went wrong, after failed().
  std::string error() const;

 private:
  struct Command {
    std::uint64_t at_row = 0;  ///< rows pushed before it
    LogRun run;
    std::optional<Eigen::MatrixXd> excitation;  ///< of a start; an end has none
  };

  void queue(Command command);
  void run() noexcept;
  bool work();
  bool write_rows(std::uint64_t available, bool all);
  void execute(const Command& command);
  template <typename Action>
  void guarded(Action action) noexcept;

  RunWriter& log_;
  SampleRing& ring_;
  std::vector<RunObserver*> observers_;
  mutable std::mutex mutex_;  // of the four below
  std::condition_variable written_;
  std::deque<Command> commands_;
  std::string error_;
  bool stop_ = false;
  std::atomic<bool> failed_ = false;
  std::atomic<int> complete_runs_ = 0;
  std::int64_t last_write_ns_ = 0;
  std::int64_t last_synchronize_ns_ = 0;
  std::thread thread_;  // last: it uses all the others
};

}  // namespace stageid
