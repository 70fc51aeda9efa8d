#include "tools/interrupt.hpp"

#include <csignal>

#include "tools/exit_code.hpp"

namespace stageid {
namespace {

std::atomic<bool> interrupted = false;
std::atomic<bool> left_to_host = false;
static_assert(std::atomic<bool>::is_always_lock_free, "the only kind a signal handler may touch");

extern "C" void on_signal(int signal) {
  interrupted = true;
  std::signal(signal, SIG_DFL);
}

/// Of a terminal or connection that closed. Who ignores it, as nohup does, wants the work to go on.
void end_at_hangup() {
  if (std::signal(SIGHUP, on_signal) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
}

bool install() {
  if (left_to_host) return false;
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  end_at_hangup();
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  return true;
}

}  // namespace

const std::atomic<bool>& interrupt_flag() {
  static const bool installed = install();
  static_cast<void>(installed);
  return interrupted;
}

void leave_signals_to_host() noexcept { left_to_host = true; }

void request_interrupt() noexcept { interrupted = true; }

void forget_interrupt() noexcept { interrupted = false; }

void throw_if_interrupted() {
  if (interrupt_flag()) throw Interrupted();
}

}  // namespace stageid
