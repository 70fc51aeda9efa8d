#pragma once

#include <stdexcept>

namespace stageid {

/// How the program ends; see `stageid --help`.
enum ExitCode : int {
  kDone = 0,
  kWorldFailed = 1,     ///< file, link, interlock
  kRequestWrong = 2,    ///< usage, configuration, file format
  kNotTrustworthy = 3,  ///< done, the result is written and says why not
  kStoppedForSafety = 4,
  kInterrupted = 130
};

/// Thrown where a signal ends work that has nothing to keep.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("interrupted; nothing was written") {}
};

}  // namespace stageid
