// Between start() and the end of a run, the whole cycle (controller, limits, simulated plant, ring) allocates nothing,
// takes no lock, and calls the kernel only for the time and to sleep.
#include <gtest/gtest.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "acquisition/loop/measurement_loop.hpp"
#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "hal/stage/limited_stage.hpp"
#include "tests/acquisition/loop/run_experiment_fixture.hpp"
#include "tests/support/process/heap_use.hpp"
#include "tests/support/process/lock_counter.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_loop_purity {

constexpr std::uint64_t kSamples = 2000;

/// A simulated stage that stamps its samples. Every tenth is late.
class StampingStage final : public CyclicStage {
 public:
  explicit StampingStage(const test::SimulatedSpec& spec)
      : plant_(test::simulated(spec)), info_(plant_->info()) {
    info_.stamps = info_.clock == Clock::wall;
  }
  const StageInfo& info() const noexcept override { return info_; }
  void start(std::uint64_t seed, Inputs& first) override { plant_->start(seed, first); }
  Outcome exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept override {
    const Outcome outcome = plant_->exchange(outputs, inputs, deadline);
    if (!info_.stamps) return outcome;
    const auto period_ns = static_cast<std::int64_t>(1e9 / info_.sample_rate_hz);
    inputs.t_arrival_ns = inputs.t_sample_ns + 1000;
    inputs.stamp_ns = static_cast<std::int64_t>(inputs.cycle) * period_ns +
                      (inputs.cycle % 10 == 0 ? period_ns / 4 : 0);
    inputs.stamp_of_stage = true;
    return outcome;
  }
  void stop() noexcept override { plant_->stop(); }

 private:
  std::unique_ptr<SimulatedStage> plant_;
  StageInfo info_;
};

/// The whole wafer stage in closed loop, in virtual time (pace 0) or on the wall clock, with a missed cycle and samples
/// that are late to cover the exceptional paths.
class WholeLoop {
 public:
  explicit WholeLoop(double pace)
      : spec_(spec_of(pace)),
        stage_(std::make_unique<StampingStage>(spec_), spec_.limits),
        controller_(spec_.controller),
        ring_(spec_.info.actuators.size() + spec_.info.sensors.size() + 2, 4096),
        loop_(stage_, controller_, ring_,
              {.ramp_s = 0.01,
               .jitter_s = 50e-6,
               .jitter_rms_s = 5e-6,
               .misses_allowed = 1'000'000}) {
    LoopExcitation excitation;
    excitation.period = Eigen::MatrixXd::Constant(100, 1, 0.1);
    excitation.actuators = {0};
    excitation.samples = kSamples;
    loop_.start(1, excitation);
  }
  void run() noexcept {
    while (loop_.step() == LoopStatus::running) {
    }
  }
  const MeasurementLoop& loop() const { return loop_; }

 private:
  static test::SimulatedSpec spec_of(double pace) {
    test::SimulatedSpec spec = test::wafer_stage_spec();
    spec.pace = pace;
    spec.simulation.faults = {{SimulationSpec::Fault::Kind::missed_cycle, 0, 300, 2, -1}};
    return spec;
  }

  test::SimulatedSpec spec_;
  LimitedStage stage_;
  MotionController controller_;
  SampleRing ring_;
  MeasurementLoop loop_;
};

class LoopPurity : public testing::TestWithParam<double> {};

TEST_P(LoopPurity, NoAllocationAndNoLock) {
  if (!test::AllocationCounter::works() || !test::LockCounter::works())
    GTEST_SKIP() << "malloc or the locks are not ours in this build";
  WholeLoop whole(GetParam());
  const test::AllocationCounter allocations;
  const test::LockCounter locks;
  whole.run();
  EXPECT_EQ(allocations.count(), 0U);
  EXPECT_EQ(locks.count(), 0U);
  EXPECT_EQ(whole.loop().health().cycles, kSamples);
  EXPECT_EQ(whole.loop().timing().empty(), GetParam() == 0.0);
  EXPECT_EQ(whole.loop().health().irregular > 0, GetParam() > 0.0) << "judged by their stamps";
}

/// Counts from the end of start(), when the stage may move, to the first exchange.
class CountingStage final : public CyclicStage {
 public:
  const StageInfo& info() const noexcept override { return plant_.info(); }
  void start(std::uint64_t seed, Inputs& first) override {
    plant_.start(seed, first);
    allocations_.emplace();
    locks_.emplace();
  }
  Outcome exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept override {
    if (outputs.cycle == 0) {
      allocations += allocations_->count();
      locks += locks_->count();
      ++runs;
    }
    return plant_.exchange(outputs, inputs, deadline);
  }
  void stop() noexcept override { plant_.stop(); }

  std::uint64_t allocations = 0;
  std::uint64_t locks = 0;
  int runs = 0;

 private:
  test::AnalyticStage plant_{1, 1};
  std::optional<test::AllocationCounter> allocations_;
  std::optional<test::LockCounter> locks_;
};

TEST(LoopPurityBegin, NothingIsAllocatedOrLockedOnceTheStageMoves) {
  if (!test::AllocationCounter::works() || !test::LockCounter::works())
    GTEST_SKIP() << "malloc or the locks are not ours in this build";
  const test::TemporaryDirectory directory;
  const ExperimentPlan plan = test::small_plan(3, 2, {{"u1", 1.0, {}}});
  auto counting = std::make_unique<CountingStage>();
  const CountingStage& counts = *counting;
  StageLimits limits;
  limits.actuator_n = Eigen::VectorXd::Constant(1, 50.0);
  LimitedStage stage(std::move(counting), limits);
  MotionController controller(test::analytic_controller(stage.info()));
  SlogWriter log =
      SlogWriter::create(directory / "run.slog", experiment_log_info(plan, stage.info()));
  EXPECT_EQ(run_experiment(plan, stage, controller, log).end, ExperimentEnd::complete);
  EXPECT_EQ(counts.runs, 3);
  EXPECT_EQ(counts.allocations, 0U);
  EXPECT_EQ(counts.locks, 0U);
}

TEST(LockCounter, CountsALockThatIsFree) {
  if (!test::LockCounter::works()) GTEST_SKIP() << "the locks are not ours in this build";
  std::mutex mutex;
  const test::LockCounter counter;
  for (int i = 0; i < 3; ++i) const std::lock_guard lock(mutex);
  EXPECT_EQ(counter.count(), 3U);
}

/// From now on, any system call except sleep, time and exit kills this process.
bool forbid_system_calls() {
  std::vector<sock_filter> filter = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr))};
  for (const unsigned number : {SYS_clock_nanosleep, SYS_clock_gettime, SYS_exit_group}) {
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, number, 0, 1));
    filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
  }
  filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS));
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr bool kOwnSystemCalls = false;  // sanitizers make calls of their own
#else
constexpr bool kOwnSystemCalls = true;
#endif
constexpr const char* kCannotForbid =
    kOwnSystemCalls ? "no seccomp here" : "the sanitizer makes system calls of its own";

/// Wait status of a child that does `work` with system calls forbidden; nothing if they cannot be forbidden.
template <typename Work>
std::optional<int> status_without_system_calls(Work work) {
  if (!kOwnSystemCalls) return std::nullopt;
  const pid_t child = ::fork();
  if (child == 0) {
    if (!forbid_system_calls()) ::_exit(77);
    work();
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 77) return std::nullopt;
  return status;
}

TEST_P(LoopPurity, NoSystemCallButSleepAndTime) {
  WholeLoop whole(GetParam());
  const std::optional<int> status = status_without_system_calls([&] { whole.run(); });
  if (!status) GTEST_SKIP() << kCannotForbid;
  EXPECT_TRUE(WIFEXITED(*status)) << "killed by signal " << WTERMSIG(*status);
}

TEST(LoopPurityControl, AMemoryMapWouldHaveBeenSeen) {
  const std::optional<int> status = status_without_system_calls([] {
    static_cast<void>(::mmap(nullptr, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
  });
  if (!status) GTEST_SKIP() << kCannotForbid;
  EXPECT_TRUE(WIFSIGNALED(*status) && WTERMSIG(*status) == SIGSYS);
}

INSTANTIATE_TEST_SUITE_P(VirtualAndWall, LoopPurity, testing::Values(0.0, 1.0));

}  // namespace stageid::test_loop_purity
