#include "tools/terminal/interrupt.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "acquisition/files/output_file.hpp"
#include "tools/terminal/exit_code.hpp"

namespace stageid {
namespace {

// A second signal within this time is considered part of the first; a stage may still be in its stop ramp.
constexpr std::chrono::seconds kControlledStop{2};

std::atomic<bool> interrupted = false;
std::atomic<bool> ending = false;
std::atomic<int> controlled_stops = 0;

/// State shared by the thread that waits for signals and the others.
struct AtInterrupt {
  std::mutex mutex;
  std::function<void()> clean_up;
  std::string what_is_left = "nothing was written";
};

/// Never destroyed: the thread may outlive main().
AtInterrupt& at_interrupt() {
  static auto* const shared = new AtInterrupt;
  return *shared;
}

[[noreturn]] void end_program() {
  ending = true;
  AtInterrupt& shared = at_interrupt();
  const std::lock_guard lock(shared.mutex);
  if (shared.clean_up) shared.clean_up();  // may wait for an output that is being written
  remove_unfinished_files();               // from here on, none can be begun
  const std::string message = fmt::format("stageid: interrupted; {}\n", shared.what_is_left);
  static_cast<void>(!::write(STDERR_FILENO, message.data(), message.size()));
  ::_exit(kInterrupted);
}

[[noreturn]] void wait_for_signals(sigset_t signals) {
  using Clock = std::chrono::steady_clock;
  std::optional<Clock::time_point> first;
  for (;;) {
    int signal = 0;
    if (::sigwait(&signals, &signal) != 0) continue;
    if (controlled_stops == 0) end_program();
    interrupted = true;
    if (!first) first = Clock::now();
    if (Clock::now() - *first > kControlledStop) end_program();
  }
}

bool is_ignored(int signal) {
  struct sigaction action {};
  return ::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

void catch_signals() {
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  sigset_t signals;
  ::sigemptyset(&signals);
  // A process that ignores a signal, as under nohup, should continue.
  for (const int signal : {SIGINT, SIGTERM, SIGHUP})
    if (!is_ignored(signal)) ::sigaddset(&signals, signal);
  // Threads inherit the mask, so only the waiting one receives the signals.
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  static_cast<void>(at_interrupt());
  std::thread(wait_for_signals, signals).detach();
}

const std::atomic<bool>& interrupt_flag() { return interrupted; }

void request_interrupt() noexcept { interrupted = true; }

void forget_interrupt() noexcept { interrupted = false; }

ControlledStop::ControlledStop() { ++controlled_stops; }

ControlledStop::~ControlledStop() { --controlled_stops; }

CleanedUpAtInterrupt::CleanedUpAtInterrupt(std::function<void()> clean_up) {
  const std::lock_guard lock(at_interrupt().mutex);
  at_interrupt().clean_up = std::move(clean_up);
}

CleanedUpAtInterrupt::~CleanedUpAtInterrupt() {
  const std::lock_guard lock(at_interrupt().mutex);
  at_interrupt().clean_up = nullptr;
}

void say_at_interrupt(std::string what_is_left) {
  const std::lock_guard lock(at_interrupt().mutex);
  at_interrupt().what_is_left = std::move(what_is_left);
}

void wait_if_ending() noexcept {
  while (ending) std::this_thread::sleep_for(std::chrono::seconds(1));
}

void throw_if_interrupted() {
  if (interrupt_flag()) throw Interrupted();
}

}  // namespace stageid
