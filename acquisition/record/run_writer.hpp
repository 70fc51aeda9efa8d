#pragma once

#include <Eigen/Core>
#include <span>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// Destination of the runs of an experiment, row by row: a file (SlogWriter) or memory.
class RunWriter {
 public:
  virtual ~RunWriter() = default;

  virtual const LogInfo& info() const noexcept = 0;
  /// Starts a run; `excitation` is one period, period_samples x excitation channels.
  /// This and the functions below throw if the destination fails; no further run is written then.
  virtual void begin_run(const LogRun& run,
                         const Eigen::Ref<const Eigen::MatrixXd>& excitation) = 0;
  /// Rows of actuators + sensors + stamp word, if info() has stamps, + status word, row-major (slog_format.hpp).
  virtual void write(std::span<const double> rows) = 0;
  /// Ends the run. `complete` in `run`: it may be used; `health`: its counts.
  virtual void end_run(const LogRun& run) = 0;
  /// Flushes everything written to the medium, if there is one.
  virtual void synchronize() = 0;
};

}  // namespace stageid
