// Between start() and stop() nothing in hal allocates: not in normal operation, at a limit, or in a fault.
#include <gtest/gtest.h>

#include <memory>
#include <tuple>

#include "hal/simulator/rigid_body.hpp"
#include "hal/stage/limited_stage.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/replay_stage.hpp"
#include "tests/hal/stage/fake_stage.hpp"
#include "tests/hal/stage_bench.hpp"
#include "tests/support/process/heap_use.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_allocation {

using Kind = SimulationSpec::Fault::Kind;

struct Allocation : testing::Test {
  void SetUp() override {
    if (!test::AllocationCounter::works()) GTEST_SKIP() << "malloc is not ours in this build";
  }
  // Allocations of 2000 cycles of control and exchange; `seen` counts the outcomes that were not ok.
  static std::uint64_t cycles(const test::SimulatedSpec& spec, int& seen) {
    StageLimits limits = spec.limits;
    limits.motion = rigid_motion(spec.controller, spec.info.actuators, spec.info.sensors);
    LimitedStage stage(test::simulated(spec), limits);
    MotionController controller(spec.controller);
    test::Driver host(stage);
    host.start();
    const test::AllocationCounter counter;
    for (int n = 0; n < 2000; ++n) {
      controller.update(host.y.data(), host.u.data());
      host.u[0] += n % 100 < 50 ? 1.0 : -1.0;
      seen += host.step() == Outcome::ok ? 0 : 1;
    }
    return counter.count();
  }
};

TEST_F(Allocation, CounterCounts) {
  const test::AllocationCounter counter;
  double* volatile memory = new double[3];  // volatile: the pair must not be optimized away
  delete[] memory;
  EXPECT_GE(counter.count(), 1U);
}

TEST_F(Allocation, AHealthyCycleHasNone) {
  int seen = 0;
  EXPECT_EQ(cycles(test::wafer_stage_spec(), seen), 0U);
  EXPECT_EQ(seen, 0);
}

TEST_F(Allocation, ABrakeHasNone) {
  test::SimulatedSpec spec = test::wafer_stage_spec();
  spec.simulation.faults = {{Kind::nan_sensor, 0, 1000, 1, -1}};
  int seen = 0;
  EXPECT_EQ(cycles(spec, seen), 0U);
  EXPECT_EQ(seen, 1000);
}

TEST_F(Allocation, AMassThatGrowsHasNone) {
  test::SimulatedSpec spec = test::wafer_stage_spec();
  spec.simulation.faults = {{Kind::added_mass, 2, 500, 1, -1, 0.3, 0.1}};
  int seen = 0;
  EXPECT_EQ(cycles(spec, seen), 0U);
  EXPECT_EQ(seen, 0);
}

TEST_F(Allocation, ACycleWithEveryOptionHasNone) {
  test::SimulatedSpec spec = test::wafer_stage_spec();
  spec.plant.cubic_stiffness_n_m3 = 1e9;
  spec.plant.actuator_saturation_n = 10.0;
  spec.simulation.actuator_quantum_n = 1e-4;
  spec.simulation.sensor_quantum_m = 1e-10;
  spec.simulation.faults = {{Kind::stuck_actuator, 3, 100, 1, -1},
                            {Kind::missed_cycle, 0, 200, 5, -1},
                            {Kind::dead_sensor, 4, 300, 1, -1},
                            {Kind::nan_sensor, 0, 400, 1, -1},
                            {Kind::sensor_gain, -1, 500, 1, -1, 1.01, 0.02},
                            {Kind::sensor_noise, -1, 500, 1, -1, 2.0, 0.02},
                            {Kind::mode_frequency, -1, 500, 1, -1, -0.01, 0.02},
                            {Kind::mode_damping, 6, 600, 1, -1, 0.5},
                            {Kind::interlock, 0, 1500, 1, -1}};
  int seen = 0;
  EXPECT_EQ(cycles(spec, seen), 0U);
  EXPECT_EQ(seen, 1705);  // five missed, and everything from cycle 300 on
}

TEST_F(Allocation, ACycleAtALimitHasNone) {
  test::SimulatedSpec spec = test::wafer_stage_spec();
  spec.limits.actuator_n.setConstant(0.9);
  spec.limits.thermal_rms_n.setConstant(0.5);
  spec.limits.thermal_time_constant_s = 0.01;
  spec.limits.position_window_m.setConstant(1e-8);
  int seen = 0;
  EXPECT_EQ(cycles(spec, seen), 0U);
  EXPECT_EQ(seen, 2000);
}

struct OneRun final : ReplaySource {
  int runs() const override { return 1; }
  void load(int, Eigen::MatrixXd& u, Eigen::MatrixXd& y, Eigen::VectorXi& marked) override {
    u.setZero(2, 100);
    y.setZero(1, 100);
    marked.setZero(100);
  }
};

TEST_F(Allocation, AReplayedCycleHasNone) {
  ReplayStage replay(test::FakeStage(2, 1, 1e3).info(), std::make_unique<OneRun>(), 0.0);
  test::Driver host(replay);
  host.start();
  const test::AllocationCounter counter;
  for (int n = 0; n < 101; ++n) std::ignore = host.step();
  EXPECT_EQ(counter.count(), 0U);
}

}  // namespace stageid::test_allocation
