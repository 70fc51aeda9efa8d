#pragma once

#include <cstddef>
#include <span>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// Observes the writing of a log. It is called by the log's thread, after the log itself, so it delays the
/// disk but never the loop; it must not block.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  virtual void begin_run(const LogRun& run) noexcept = 0;
  /// Rows of `words` words, row-major: actuators, sensors, ..., status word (slog_format.hpp).
  virtual void rows(std::span<const double> rows, std::size_t words) noexcept = 0;
  virtual void end_run(const LogRun& run) noexcept = 0;
};

}  // namespace stageid
