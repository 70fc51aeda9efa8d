#pragma once

#include <atomic>
#include <functional>
#include <string>

namespace stageid {

/// From now on the first SIGINT, SIGTERM or SIGHUP (unless it is ignored) removes what is unfinished and ends the
/// program with exit code 130, whatever it does; under a ControlledStop it only sets interrupt_flag(), and a signal more
/// than two seconds later ends the program. A thread waits for the signals, so that ending is ordinary code; call it in main(),
/// before other threads are started, and not in a host that handles signals itself, such as Python.
/// Also ignores SIGXFSZ and SIGPIPE, so that a full disk and a closed pipe are errors of the write.
void catch_signals();

/// Set by request_interrupt(), or by a signal under a ControlledStop.
const std::atomic<bool>& interrupt_flag();

/// As if the first signal under a ControlledStop had come. From any thread.
void request_interrupt() noexcept;

/// Clears the flag so that the host process can continue.
void forget_interrupt() noexcept;

/// While it lives the first signal only sets the flag: for work that looks at the flag and has to end in order, such
/// as a stage that moves, or a fit that keeps its best model.
class ControlledStop {
 public:
  ControlledStop();
  ~ControlledStop();
  ControlledStop(const ControlledStop&) = delete;
  ControlledStop& operator=(const ControlledStop&) = delete;
};

/// While it lives a signal that ends the program calls this first, from another thread.
class CleanedUpAtInterrupt {
 public:
  explicit CleanedUpAtInterrupt(std::function<void()> clean_up);
  ~CleanedUpAtInterrupt();
  CleanedUpAtInterrupt(const CleanedUpAtInterrupt&) = delete;
  CleanedUpAtInterrupt& operator=(const CleanedUpAtInterrupt&) = delete;
};

/// What a signal that ends the program says is left; default: "nothing was written".
void say_at_interrupt(std::string what_is_left);

/// Does not return if a signal is ending the program: what fails because of that is not reported.
void wait_if_ending() noexcept;

/// @throws Interrupted if the flag is set.
void throw_if_interrupted();

}  // namespace stageid
