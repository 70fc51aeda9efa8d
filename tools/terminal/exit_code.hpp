#pragma once

#include <stdexcept>

namespace stageid {

/// Exit codes of the program; see `stageid --help`.
enum ExitCode : int {
  kDone = 0,
  kWorldFailed = 1,     ///< file, link, interlock
  kRequestWrong = 2,    ///< usage, configuration, file format
  kNotTrustworthy = 3,  ///< done; the result was written with the reason
  kStoppedForSafety = 4,
  kInterrupted = 130
};

/// Thrown when a signal ends work without a partial result.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("interrupted; nothing was written") {}
};

}  // namespace stageid
