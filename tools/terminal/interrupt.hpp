#pragma once

#include <atomic>
#include <functional>
#include <string>

namespace stageid {

/// After this call, the first SIGINT, SIGTERM or SIGHUP (unless it is ignored) removes unfinished files and ends the
/// program with exit code 130 at any point. Under a ControlledStop it only sets interrupt_flag(), and a signal more
/// than two seconds later ends the program. A thread waits for the signals, so ending is ordinary code. Call it in
/// main(), before other threads are started, and not in a host that handles signals itself, such as Python. Also
/// ignores SIGXFSZ and SIGPIPE, so that a full disk and a closed pipe are errors of the write.
void catch_signals();

/// Set by request_interrupt(), or by a signal under a ControlledStop.
const std::atomic<bool>& interrupt_flag();

/// Has the effect of the first signal under a ControlledStop. From any thread.
void request_interrupt() noexcept;

/// Clears the flag so that the host process can continue.
void forget_interrupt() noexcept;

/// During its lifetime, the first signal only sets the flag. For work that checks the flag and has to end in order,
/// such as a moving stage, or a fit that keeps its best model.
class ControlledStop {
 public:
  ControlledStop();
  ~ControlledStop();
  ControlledStop(ControlledStop&&) = delete;
};

/// During its lifetime, a signal that ends the program calls the function first, from another thread.
class CleanedUpAtInterrupt {
 public:
  explicit CleanedUpAtInterrupt(std::function<void()> clean_up);
  ~CleanedUpAtInterrupt();
  CleanedUpAtInterrupt(CleanedUpAtInterrupt&&) = delete;
};

/// Sets the text that a signal prints about partial results when it ends the program; default: "nothing was written".
void say_at_interrupt(std::string what_is_left);

/// Does not return if a signal is ending the program, so that errors caused by that are not reported.
void wait_if_ending() noexcept;

/// @throws Interrupted if the flag is set.
void throw_if_interrupted();

}  // namespace stageid
