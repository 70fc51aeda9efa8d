#pragma once

#include <Eigen/Core>
#include <mutex>
#include <string>

#include "acquisition/loop/run_observer.hpp"

namespace stageid {

/// The last seconds of every channel, actuators then sensors: least and largest value of each of many short bins, so that
/// a peak of one sample is seen. As LiveLevels, it never keeps the thread of the log waiting.
class LiveTraces final : public RunObserver {
 public:
  static constexpr Eigen::Index kBins = 500;
  static constexpr double kSeconds = 2.0;

  LiveTraces(Eigen::Index channels, double sample_rate_hz);

  void begin_run(const LogRun&) noexcept override {}
  void rows(std::span<const double> rows, std::size_t words) noexcept override;
  void end_run(const LogRun&) noexcept override {}

  /// {"bin_s": length of a bin, "bins": kBins, "low": [...], "high": [...]} of a channel in SI, oldest first; empty lists
  /// before the first bin and for unknown channels.
  std::string json(Eigen::Index channel) const;

 private:
  void finish_bin() noexcept;

  Eigen::Index samples_per_bin_;
  double bin_s_;
  // Only used by the thread of the log.
  Eigen::ArrayXd least_;
  Eigen::ArrayXd largest_;
  Eigen::Index samples_ = 0;
  mutable std::mutex mutex_;  // of the rest: rings of the last bins, channels x kBins
  Eigen::ArrayXXd low_;
  Eigen::ArrayXXd high_;
  Eigen::Index bins_ = 0;  // so far
};

}  // namespace stageid
