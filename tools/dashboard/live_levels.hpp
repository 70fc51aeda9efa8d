#pragma once

#include <Eigen/Core>
#include <mutex>

#include "acquisition/loop/run_observer.hpp"

namespace stageid {

/// Levels of every channel, actuators then sensors, in SI.
struct Levels {
  Eigen::ArrayXd peak;          ///< largest magnitude since the last take()
  Eigen::ArrayXd rms;           ///< since the last take()
  Eigen::ArrayXd largest_peak;  ///< since the start
  std::uint64_t rows = 0;       ///< since the last take()
};

/// Watches the levels of all samples on their way into the log. The thread of the log never waits here: if a reader
/// holds the lock, the numbers are handed over with the next block.
class LiveLevels final : public RunObserver {
 public:
  explicit LiveLevels(Eigen::Index channels);

  void begin_run(const LogRun&) noexcept override {}
  void rows(std::span<const double> rows, std::size_t words) noexcept override;
  void end_run(const LogRun& run) noexcept override;

  /// The levels since the last call.
  Levels take();
  /// Totals of the completed runs, and the last of them.
  struct Ended {
    RunHealth health;
    RunTiming timing;
    int runs = 0;
    LogRun last;
  };
  Ended ended() const;

 private:
  struct Sums {
    explicit Sums(Eigen::Index channels);
    void add(const Sums& other);
    void clear();
    Eigen::ArrayXd peak;
    Eigen::ArrayXd squares;
    std::uint64_t rows = 0;
  };

  Sums gathered_;  // only used by the thread of the log
  mutable std::mutex mutex_;
  Sums handed_over_;
  Eigen::ArrayXd largest_;
  mutable std::mutex ended_mutex_;
  Ended ended_;
};

}  // namespace stageid
