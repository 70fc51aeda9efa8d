#pragma once

#include <atomic>

namespace stageid {

/// From now on SIGINT, SIGTERM and SIGHUP (unless it is ignored) set this instead of ending the program. The
/// second signal of a kind ends it.
/// Also ignores SIGXFSZ and SIGPIPE, so that a full disk and a closed pipe are errors of the write.
const std::atomic<bool>& interrupt_flag();

/// For a host that handles signals itself, such as Python: none is caught, and only
/// request_interrupt() sets the flag. Before the first use of anything here.
void leave_signals_to_host() noexcept;

/// As if the first signal had come. From any thread.
void request_interrupt() noexcept;

/// What was interrupted has ended; the host goes on.
void forget_interrupt() noexcept;

/// While it lives the first signal ends the program, with exit code 130: for long computations that have written
/// nothing yet and look at no flag.
class EndsAtOnce {
 public:
  EndsAtOnce();
  ~EndsAtOnce();
  EndsAtOnce(const EndsAtOnce&) = delete;
  EndsAtOnce& operator=(const EndsAtOnce&) = delete;
};

/// @throws Interrupted if a signal came.
void throw_if_interrupted();

}  // namespace stageid
