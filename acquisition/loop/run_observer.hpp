#pragma once

#include <span>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// Looks on while a log is written: told by the log's thread, behind the log itself. What it does
/// takes time from the disk, never from the loop; it must not wait for anybody.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  virtual void begin_run(const LogRun& run) noexcept = 0;
  /// Rows of actuators + sensors + status word, row-major (slog_format.hpp).
  virtual void rows(std::span<const double> rows) noexcept = 0;
  virtual void end_run(const LogRun& run) noexcept = 0;
};

}  // namespace stageid
