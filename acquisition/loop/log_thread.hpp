#pragma once

#include <Eigen/Core>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "acquisition/loop/run_observer.hpp"
#include "acquisition/loop/sample_ring.hpp"
#include "acquisition/record/log_info.hpp"
#include "acquisition/record/run_writer.hpp"

namespace stageid {

/// The thread that writes the ring to the log, so that the loop never waits for a disk.
///
/// Starts and ends of runs are queued with their row, so that the loop may begin the next run while the last one
/// is still being written. The log is synchronized once per second and after every run. If the log fails,
/// later rows are discarded and failed() is true. Observers receive everything after the log, even if the
/// log has failed.
class LogThread {
 public:
  /// The destructor waits until everything that is queued is written.
  LogThread(RunWriter& log, SampleRing& ring, std::vector<RunObserver*> observers = {});

  // Called between runs, by the producer's thread; they take a lock. Nothing of a run is written before it is
  // confirmed.
  void begin_run(LogRun run, Eigen::MatrixXd excitation);
  void forget_run();  ///< the run that was begun did not start
  void end_run(LogRun run);
  /// The run that was begun has started. Neither locks nor allocates, because the stage may move.
  void confirm_run() noexcept { unconfirmed_.store(false, std::memory_order_release); }

  /// Waits until everything queued is written and synchronized, or the log has failed.
  void drain();

  bool failed() const noexcept { return failed_.load(std::memory_order_relaxed); }
  /// Number of runs that are completely in the log.
  int complete_runs() const noexcept { return complete_runs_.load(std::memory_order_relaxed); }
  /// Error message after failed().
  std::string error() const;

 private:
  struct Command {
    std::uint64_t at_row = 0;  ///< number of rows pushed before it
    LogRun run;
    std::optional<Eigen::MatrixXd> excitation;  ///< only for the start of a run
  };

  void queue(Command command);
  void run(const std::stop_token& stop) noexcept;
  bool work(bool stop);
  bool write_rows(std::uint64_t available, bool all);
  void execute(const Command& command);
  template <typename Action>
  void guarded(Action action) noexcept;

  RunWriter& log_;
  SampleRing& ring_;
  std::vector<RunObserver*> observers_;
  mutable std::mutex mutex_;  // guards the three members below
  std::condition_variable written_;
  std::deque<Command> commands_;
  std::string error_;
  std::atomic<bool> unconfirmed_ = false;  // the last command begins a run that may not start
  std::atomic<bool> failed_ = false;
  std::atomic<int> complete_runs_ = 0;
  std::int64_t last_write_ns_ = 0;
  std::int64_t last_synchronize_ns_ = 0;
  std::jthread thread_;  // last: it uses all other members
};

}  // namespace stageid
