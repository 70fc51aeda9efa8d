#include "tools/interrupt.hpp"

#include <unistd.h>

#include <csignal>
#include <string_view>

#include "tools/exit_code.hpp"

namespace stageid {
namespace {

std::atomic<bool> interrupted = false;
std::atomic<bool> left_to_host = false;
static_assert(std::atomic<bool>::is_always_lock_free, "the only kind a signal handler may touch");

std::atomic<bool> end_at_once = false;

extern "C" void on_signal(int signal) {
  if (end_at_once) {
    constexpr std::string_view kMessage = "stageid: interrupted; nothing was written\n";
    static_cast<void>(!::write(STDERR_FILENO, kMessage.data(), kMessage.size()));
    ::_exit(kInterrupted);
  }
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

EndsAtOnce::EndsAtOnce() { end_at_once = true; }

EndsAtOnce::~EndsAtOnce() { end_at_once = false; }

void throw_if_interrupted() {
  if (interrupt_flag()) throw Interrupted();
}

}  // namespace stageid
