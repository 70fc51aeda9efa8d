#include "hal/stage/real_time.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <future>

#include "excitation/words/require.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {
namespace {

void check(const RealTimeOptions& options) {
  require(options.priority >= 1 && options.priority <= 99,
          "realtime: priority {} is out of range; give 1 to 99", options.priority);
  const long processors = ::sysconf(_SC_NPROCESSORS_CONF);
  require(options.cpu >= -1 && options.cpu < processors,
          "realtime: cpu {} is out of range; give 0 to {}, or -1 for any", options.cpu,
          processors - 1);
}

bool kernel_is_preempt_rt() {
  utsname name{};
  ::uname(&name);
  std::string flag;
  std::ifstream("/sys/kernel/realtime") >> flag;
  return is_preempt_rt(name.version, flag);
}

/// @returns the failure; empty if there is none.
std::string take_priority(int priority) {
  sched_param wanted{};
  wanted.sched_priority = priority;
  const int error = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &wanted);
  if (error == 0) return "";
  return fmt::format(
      "SCHED_FIFO with priority {} was refused ({}); run as root, or give the user 'rtprio {}' in "
      "/etc/security/limits.conf",
      priority, std::strerror(error), priority);
}

std::string pin(int cpu) {
  if (cpu < 0) return "";
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(cpu), &set);
  const int error = ::pthread_setaffinity_np(::pthread_self(), sizeof set, &set);
  if (error == 0) return "";
  return fmt::format(
      "the loop could not be pinned to processor {} ({}); choose a processor that this process may "
      "use",
      cpu, std::strerror(error));
}

std::string lock_memory() {
  if (::mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) return "";
  return fmt::format(
      "memory could not be locked ({}); run as root, give the user 'memlock unlimited' in "
      "/etc/security/limits.conf, or set lock_memory: false",
      std::strerror(errno));
}

}  // namespace

bool is_preempt_rt(std::string_view version, std::string_view flag) noexcept {
  // Kernels before 6.12 are patched and have the file; later ones report it in their version.
  return flag == "1" || version.find("PREEMPT_RT") != std::string_view::npos;
}

RealTime::RealTime(const RealTimeOptions& options) {
  if (options.policy == RealTimePolicy::off) return;
  check(options);
  const auto note = [this](std::string what) {
    if (!what.empty()) missing_.push_back(std::move(what));
  };
  if (!kernel_is_preempt_rt())
    note(
        "the kernel does not have PREEMPT_RT, so cycles can be late by milliseconds; install a "
        "real-time kernel (Debian: linux-image-rt-amd64)");
  note(pin(options.cpu));
  note(take_priority(options.priority));
  // Helps if the priority was refused: the default timer slack delays other threads by up to 50 us.
  ::prctl(PR_SET_TIMERSLACK, 1UL);
  if (options.lock_memory) {
    std::string failure = lock_memory();
    locked_ = failure.empty();
    note(std::move(failure));
  }
  if (options.policy == RealTimePolicy::require && !missing_.empty()) {
    if (locked_) ::munlockall();
    throw StageError(
        fmt::format("realtime: {}; or set policy: try", fmt::join(missing_, "; and ")));
  }
}

RealTime::~RealTime() {
  if (locked_) ::munlockall();
}

void take_normal_priority() noexcept {
  const sched_param normal{};
  static_cast<void>(::pthread_setschedparam(::pthread_self(), SCHED_OTHER, &normal));
}

std::vector<std::string> missing_for_real_time(const RealTimeOptions& options) {
  return std::async(std::launch::async, [&] { return RealTime(options).missing(); }).get();
}

}  // namespace stageid
