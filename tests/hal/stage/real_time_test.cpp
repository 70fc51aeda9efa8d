#include "hal/stage/real_time.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/utsname.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <functional>
#include <stdexcept>
#include <thread>

#include "tests/hal/stage_bench.hpp"

namespace stageid::test_real_time {

bool this_kernel_is_rt() {
  utsname name{};
  ::uname(&name);
  std::string flag;
  std::ifstream("/sys/kernel/realtime") >> flag;
  return is_preempt_rt(name.version, flag);
}

/// Runs `work` in a child without permissions; true if it returned true there.
bool without_rights(const std::function<bool()>& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_RTPRIO, &none);
    ::setrlimit(RLIMIT_MEMLOCK, &none);
    if (::geteuid() == 0 && ::setuid(65534) != 0) ::_exit(2);
    ::_exit(work() ? 0 : 1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

bool mentions(const std::vector<std::string>& lines, const std::string& word) {
  for (const std::string& line : lines)
    if (line.find(word) != std::string::npos) return true;
  return false;
}

TEST(RealTime, KernelsTellWhatTheyAre) {
  EXPECT_TRUE(is_preempt_rt("#1 SMP PREEMPT_RT Debian 6.12.9-1 (2025-01-10)", ""));
  EXPECT_TRUE(is_preempt_rt("#1 SMP Debian 4.19", "1"));
  EXPECT_FALSE(is_preempt_rt("#1 SMP PREEMPT_DYNAMIC Debian 6.1.170-1", ""));
  EXPECT_FALSE(is_preempt_rt("#1 SMP PREEMPT", "0"));
}

TEST(RealTime, OffAsksForNothing) {
  const int before = ::sched_getscheduler(0);
  const RealTime none({});
  EXPECT_TRUE(none.missing().empty());
  EXPECT_EQ(::sched_getscheduler(0), before);
}

TEST(RealTime, TryTakesWhatThereIsAndSaysWhatIsMissing) {
  std::thread([] {
    const RealTime real_time({RealTimePolicy::attempt, 10, 0, true});
    const bool refused = mentions(real_time.missing(), "SCHED_FIFO");
    EXPECT_EQ(::sched_getscheduler(0) == SCHED_FIFO, !refused);
    EXPECT_EQ(mentions(real_time.missing(), "PREEMPT_RT"), !this_kernel_is_rt());
    cpu_set_t set;
    ASSERT_EQ(::sched_getaffinity(0, sizeof set, &set), 0);
    EXPECT_TRUE(CPU_COUNT(&set) == 1 || mentions(real_time.missing(), "pinned"));
  }).join();
}

// The sanitizers' own mlockall() locks nothing and never fails.
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr bool kMemoryLockCanFail = false;
#else
constexpr bool kMemoryLockCanFail = true;
#endif

TEST(RealTime, WithoutRightsEveryMissingThingComesWithItsRemedy) {
  EXPECT_TRUE(without_rights([] {
    const auto missing = missing_for_real_time({RealTimePolicy::attempt, 80, -1, true});
    return mentions(missing, "rtprio 80") &&
           mentions(missing, "memlock unlimited") == kMemoryLockCanFail;
  }));
}

TEST(RealTime, RequireRefuses) {
  EXPECT_TRUE(without_rights([] {
    try {
      missing_for_real_time({RealTimePolicy::require, 80, -1, true});
    } catch (const StageError& error) {
      const std::string what = error.what();
      return what.find("rtprio") != std::string::npos &&
             what.find("policy: try") != std::string::npos;
    }
    return false;
  }));
}

TEST(RealTime, ThePriorityOfTheAskingThreadStaysWhatItWas) {
  const int before = ::sched_getscheduler(0);
  missing_for_real_time({RealTimePolicy::attempt, 10, -1, false});
  EXPECT_EQ(::sched_getscheduler(0), before);
}

TEST(RealTime, RefusesWhatCannotBe) {
  const auto asking = [](int priority, int cpu) {
    return [=] { const RealTime real_time({RealTimePolicy::attempt, priority, cpu, false}); };
  };
  EXPECT_THAT(asking(100, -1), test::refuses<std::invalid_argument>("1 to 99"));
  EXPECT_THAT(asking(80, 100'000), test::refuses<std::invalid_argument>("100000"));
}

}  // namespace stageid::test_real_time
