#include "hal/stage/real_time_checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_real_time_checks {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// The files of a computer with two processors that is set up for real time on processor 1.
struct RealTimeChecks : testing::Test {
  RealTimeChecks() {
    for (const char* cpu : {"cpu0", "cpu1"}) {
      write(cpu_file(cpu, "cpufreq/scaling_governor"), "performance");
      write(cpu_file(cpu, "cpuidle/state0/latency"), "0");
      write(cpu_file(cpu, "cpuidle/state1/latency"), "2");
      write(cpu_file(cpu, "cpuidle/state2/latency"), "133");
      write(cpu_file(cpu, "cpuidle/state2/disable"), "1");
    }
    write("sys/devices/system/cpu/isolated", "1");
    write("proc/irq/16/effective_affinity_list", "0");
    write("proc/irq/17/smp_affinity_list", "0");
  }
  static std::string cpu_file(const std::string& cpu, const std::string& file) {
    return "sys/devices/system/cpu/" + cpu + "/" + file;
  }
  void write(const std::string& file, const std::string& text) {
    std::filesystem::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text << "\n";
  }
  std::vector<std::string> obstacles(int cpu = 1) const {
    return real_time_obstacles(cpu, root_.path());
  }

  test::TemporaryDirectory root_;
};

TEST_F(RealTimeChecks, APreparedComputerHasNone) { EXPECT_THAT(obstacles(), IsEmpty()); }

TEST_F(RealTimeChecks, AFrequencyGovernorThatSavesPower) {
  write(cpu_file("cpu1", "cpufreq/scaling_governor"), "powersave");
  EXPECT_THAT(obstacles(), ElementsAre(AllOf(HasSubstr("cpu1"), HasSubstr("'powersave'"),
                                             HasSubstr("cpupower frequency-set"))));
  EXPECT_THAT(real_time_obstacles(0, root_.path()),
              testing::Each(testing::Not(HasSubstr("governor"))))
      << "of another processor";
}

TEST_F(RealTimeChecks, ADeepIdleState) {
  write(cpu_file("cpu1", "cpuidle/state2/disable"), "0");
  EXPECT_THAT(obstacles(), ElementsAre(AllOf(HasSubstr("133 us"), HasSubstr("max_cstate"))));
}

TEST_F(RealTimeChecks, AProcessorThatIsNotIsolated) {
  write("sys/devices/system/cpu/isolated", "");
  EXPECT_THAT(obstacles(), ElementsAre(HasSubstr("isolcpus=1")));
  write("sys/devices/system/cpu/isolated", "2-3,5");
  EXPECT_THAT(obstacles(), ElementsAre(HasSubstr("isolcpus=1")));
  write("sys/devices/system/cpu/isolated", "5,0-2");
  EXPECT_THAT(obstacles(), IsEmpty());
}

TEST_F(RealTimeChecks, InterruptsOnTheProcessorOfTheLoop) {
  write("proc/irq/17/smp_affinity_list", "0-1");
  write("proc/irq/18/effective_affinity_list", "1");
  EXPECT_THAT(obstacles(),
              ElementsAre(AllOf(HasSubstr("2 interrupts are"), HasSubstr("interrupt 17"),
                                HasSubstr("smp_affinity_list"))));
}

TEST_F(RealTimeChecks, WithoutPinningEveryProcessorCounts) {
  write(cpu_file("cpu0", "cpufreq/scaling_governor"), "ondemand");
  EXPECT_THAT(obstacles(-1), ElementsAre(HasSubstr("cpu0"), HasSubstr("not pinned")));
}

TEST(RealTimeChecksHere, NothingIsKnownWithoutTheFiles) {
  EXPECT_THAT(real_time_obstacles(0, "/does/not/exist"), IsEmpty());
}

}  // namespace stageid::test_real_time_checks
