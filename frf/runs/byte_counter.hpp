#pragma once

#include <functional>
#include <mutex>
#include <vector>

#include "frf/response/frf_options.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// Reports the bytes of samples read to FrfOptions::progress, from one thread at a time.
class ByteCounter {
 public:
  ByteCounter(const FrfOptions& options, const std::vector<RealizationRuns>& realizations)
      : tell_(options.progress) {
    for (const RealizationRuns& realization : realizations) {
      for (const UsedRun& used : realization.runs) total_ += bytes_of(used);
    }
  }
  static double bytes_of(const UsedRun& used) {
    const LogInfo& info = used.log->info();
    return static_cast<double>(used.periods) * info.period_samples *
           static_cast<double>(info.actuators.size() + info.sensors.size()) * sizeof(double);
  }
  void add(double bytes) {
    if (!tell_) return;
    const std::lock_guard lock(mutex_);
    done_ += bytes;
    tell_(done_, total_);
  }

 private:
  const std::function<void(double, double)>& tell_;
  std::mutex mutex_;
  double done_ = 0.0;
  double total_ = 0.0;
};

}  // namespace stageid
