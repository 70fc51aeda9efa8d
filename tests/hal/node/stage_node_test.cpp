#include "hal/node/stage_node.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/hal/node/small_node.hpp"
#include "tests/hal/stage/fake_stage.hpp"
#include "tests/hal/stage_bench.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_stage_node {

constexpr double kRate_hz = 1e3;
constexpr std::int64_t kMs_ns = 1'000'000;
constexpr double kGain_n_per_m = 100.0;

/// u = -100 N/m (1 + 3 Hz integrator) y.
MotionControllerSpec controller() {
  return test::one_axis_controller(kRate_hz, 10.0, kGain_n_per_m);
}

struct StageNodeTest : testing::Test {
  StageNodeTest() {
    auto fake = std::make_unique<test::FakeStage>(2, 1, kRate_hz);
    fake_ = fake.get();
    node_ = std::make_unique<StageNode>(std::move(fake), test::small_limits(), controller(),
                                        test::good_panel(), NodeOptions{0.02, 0.1});
    inputs_.y = y_;
  }
  void measure() {
    ASSERT_TRUE(node_->request(SupervisorCommand::enable).accepted);
    node_->begin_run(5, now_ns_, inputs_);
    ASSERT_EQ(node_->state(), NodeState::measuring);
  }
  Outcome advance(double u0, double u1 = 0.0) {
    const std::vector<double> u{u0, u1};
    now_ns_ += kMs_ns;
    return node_->advance(now_ns_, u, inputs_);
  }
  /// Ticks every millisecond.
  void tick_for(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) node_->tick(now_ns_ += kMs_ns);
  }

  test::FakeStage* fake_ = nullptr;
  std::unique_ptr<StageNode> node_;
  std::vector<double> y_ = std::vector<double>(1);
  Inputs inputs_;
  std::int64_t now_ns_ = 1'000'000'000;
};

TEST_F(StageNodeTest, EverySampleMovesTheStageOnce) {
  EXPECT_EQ(node_->state(), NodeState::switch_on_disabled);
  measure();
  EXPECT_EQ(fake_->seed, 5U);
  fake_->measurement = {1e-3};
  EXPECT_EQ(advance(1.0, 2.0), Outcome::ok);
  EXPECT_EQ(advance(3.0, 4.0), Outcome::ok);
  EXPECT_EQ(y_[0], 1e-3);
  EXPECT_EQ(node_->sample(), 2U);
  EXPECT_THAT(fake_->commands,
              testing::ElementsAre(testing::ElementsAre(1.0, 2.0), testing::ElementsAre(3.0, 4.0)));
  node_->end_run();
  EXPECT_EQ(node_->state(), NodeState::operation_enabled);
  EXPECT_EQ(fake_->stops, 1);
  EXPECT_EQ(advance(1.0), Outcome::fault) << "no run, no motion";
  EXPECT_EQ(inputs_.valid, 0U);
}

TEST_F(StageNodeTest, MeasuresOnlyWhenEnabled) {
  EXPECT_THROW(node_->begin_run(1, now_ns_, inputs_), StageError);
  EXPECT_EQ(advance(0.0), Outcome::fault);
  EXPECT_TRUE(fake_->commands.empty());
  ASSERT_TRUE(node_->request(SupervisorCommand::enable).accepted);
  inputs_.y = {};
  EXPECT_THROW(node_->begin_run(1, now_ns_, inputs_), StageError);
}

TEST_F(StageNodeTest, TheNodesOwnLoopIsControlPlusExcitation) {
  fake_->measurement = {1e-3};
  measure();
  std::vector<double> u(2);
  const std::vector<double> r{0.25, 0.5};
  EXPECT_EQ(node_->advance_excited(now_ns_, r, u, inputs_), Outcome::ok);
  EXPECT_THAT(u,
              testing::ElementsAre(testing::DoubleNear(-kGain_n_per_m * 1e-3 + 0.25, 1e-12), 0.5));
  EXPECT_EQ(fake_->commands.back(), u);
  EXPECT_EQ(node_->advance_excited(now_ns_, {}, u, inputs_), Outcome::fault);
  EXPECT_EQ(fake_->commands.size(), 1U);
}

TEST_F(StageNodeTest, AHostThatFallsSilentLeadsToASafeStop) {
  measure();
  fake_->measurement = {2e-3};
  EXPECT_EQ(advance(1.0), Outcome::ok);
  tick_for(20);
  EXPECT_EQ(node_->state(), NodeState::measuring) << "exactly the watchdog's time is not too long";
  EXPECT_EQ(fake_->commands.size(), 1U);
  tick_for(1);
  EXPECT_EQ(node_->state(), NodeState::fault_reaction);
  EXPECT_EQ(node_->cause(), FaultCause::watchdog);
  EXPECT_EQ(node_->trouble(), "the host stopped sending");
  EXPECT_EQ(fake_->commands.size(), 21U) << "the last force has acted on";
  EXPECT_EQ(fake_->commands.back()[0], 1.0);
  tick_for(50);
  EXPECT_EQ(fake_->stops, 0) << "held in closed loop meanwhile";
  EXPECT_EQ(fake_->commands.size(), 71U) << "a sample a millisecond";
  EXPECT_NEAR(fake_->commands.back()[0], -kGain_n_per_m * 2e-3, 1e-12);
  EXPECT_EQ(advance(9.0), Outcome::fault) << "too late, the host has lost the stage";
  tick_for(60);
  EXPECT_EQ(node_->state(), NodeState::fault);
  EXPECT_EQ(fake_->stops, 1);
  EXPECT_EQ(fake_->commands.size(), 121U);
}

TEST_F(StageNodeTest, TheLimitsAreWatchedWhileTheHostIsSilent) {
  measure();
  EXPECT_EQ(advance(1.0), Outcome::ok);
  fake_->measurement = {30e-3};  // beyond the hard window
  tick_for(21);
  EXPECT_EQ(fake_->commands.size(), 2U) << "not for the rest of the silence";
  EXPECT_EQ(fake_->stops, 1);
  EXPECT_EQ(node_->state(), NodeState::fault);
  EXPECT_EQ(node_->cause(), FaultCause::watchdog);
  EXPECT_EQ(node_->trouble(),
            "the host stopped sending; its last force moved the stage too far; not braked");
}

TEST_F(StageNodeTest, AFaultIsLeftByAResetOnly) {
  measure();
  tick_for(150);
  ASSERT_EQ(node_->state(), NodeState::fault);
  const SupervisorReply refused = node_->request(SupervisorCommand::enable);
  EXPECT_FALSE(refused.accepted);
  EXPECT_EQ(refused.message, "enable is not allowed in state fault; reset the fault first");
  EXPECT_TRUE(node_->request(SupervisorCommand::reset_fault).accepted);
  EXPECT_EQ(node_->trouble(), "");
  measure();
  EXPECT_EQ(advance(1.0), Outcome::ok);
}

TEST_F(StageNodeTest, ALimitStopsTheNodeWhateverTheHostDoes) {
  measure();
  EXPECT_EQ(advance(11.0), Outcome::limit);
  EXPECT_EQ(inputs_.node_state, NodeState::fault_reaction);
  EXPECT_EQ(fake_->commands.back()[0], 10.0);
  EXPECT_EQ(node_->cause(), FaultCause::limit);
  EXPECT_EQ(node_->trouble(), "actuator a: |u| would be 11 N, limit 10 N (cycle 0)");
  tick_for(150);
  EXPECT_EQ(node_->state(), NodeState::fault);
}

TEST_F(StageNodeTest, TheNodesOwnLoopTellsWhatItApplied) {
  measure();
  std::vector<double> u(2);
  const std::vector<double> r{25.0, 0.5};
  EXPECT_EQ(node_->advance_excited(now_ns_, r, u, inputs_), Outcome::limit);
  EXPECT_THAT(u, testing::ElementsAre(10.0, 0.5));
}

TEST_F(StageNodeTest, ItsOwnLoopEndsWithoutMeasurements) {
  measure();
  std::vector<double> u(2);
  const std::vector<double> r{0.5, 0.5};
  fake_->outcome = Outcome::stale;
  for (int n = 0; n < 5; ++n)
    EXPECT_EQ(node_->advance_excited(now_ns_, r, u, inputs_), Outcome::stale) << n;
  EXPECT_EQ(node_->advance_excited(now_ns_, r, u, inputs_), Outcome::fault);
  EXPECT_EQ(node_->trouble(), "the stage gives no measurements");
  EXPECT_EQ(inputs_.node_state, NodeState::fault_reaction);
  tick_for(3);
  EXPECT_EQ(node_->state(), NodeState::fault) << "nothing is left to hold the stage by";
  EXPECT_EQ(fake_->stops, 1);
}

TEST_F(StageNodeTest, DoesNotHoldOnASensorThatFailed) {
  measure();
  fake_->measurement = {5e-3};
  EXPECT_EQ(advance(0.0), Outcome::ok);
  fake_->measurement = {std::numeric_limits<double>::quiet_NaN()};
  EXPECT_EQ(advance(0.0), Outcome::limit);
  EXPECT_EQ(node_->cause(), FaultCause::not_finite);
  EXPECT_EQ(inputs_.valid, 0U);
  tick_for(5);
  EXPECT_EQ(node_->state(), NodeState::fault) << "no motion is known: there is nothing to hold by";
  EXPECT_EQ(fake_->stops, 1);
  EXPECT_EQ(fake_->commands.back()[0], 0.0);
  EXPECT_THAT(node_->trouble(), testing::HasSubstr("the loop was opened; not braked"));
}

TEST_F(StageNodeTest, AFaultOfTheStageCutsPowerWithoutHolding) {
  measure();
  fake_->outcome = Outcome::fault;
  EXPECT_EQ(advance(0.0), Outcome::fault);
  EXPECT_EQ(node_->cause(), FaultCause::amplifier);
  tick_for(2);
  EXPECT_EQ(node_->state(), NodeState::fault);
  EXPECT_EQ(fake_->stops, 1);
}

TEST_F(StageNodeTest, ThePanelMustBeInRange) {
  const auto refused = [&](void (*change)(NodePanel&), FaultCause cause, const char* message) {
    NodePanel bad = test::good_panel();
    change(bad);
    node_->set_panel(bad);
    const SupervisorReply reply = node_->request(SupervisorCommand::enable);
    EXPECT_FALSE(reply.accepted);
    EXPECT_EQ(reply.message, message);
    EXPECT_FALSE(node_->request(SupervisorCommand::reset_fault).accepted);
    node_->set_panel(test::good_panel());
    measure();
    node_->set_panel(bad);
    tick_for(1);
    EXPECT_EQ(node_->cause(), cause);
    EXPECT_EQ(node_->trouble(), message);
    tick_for(120);
    EXPECT_EQ(node_->state(), NodeState::fault);
    node_->set_panel(test::good_panel());
    EXPECT_TRUE(node_->request(SupervisorCommand::reset_fault).accepted);
  };
  refused([](NodePanel& p) { p.interlock_closed = false; }, FaultCause::interlock,
          "the interlock is open; close it");
  refused([](NodePanel& p) { p.gravity_compensator_n[1] = 61.0; }, FaultCause::gravity,
          "gravity compensator 2: 61 N is out of range (40 to 60 N)");
  refused([](NodePanel& p) { p.temperature_k[0] = 321.0; }, FaultCause::temperature,
          "temperature 1: 321 K is out of range (at most 320 K)");
  EXPECT_TRUE(node_->panel().interlock_closed);
}

TEST_F(StageNodeTest, AQuickStopHoldsAndSwitchesOff) {
  measure();
  EXPECT_TRUE(node_->request(SupervisorCommand::quick_stop).accepted);
  EXPECT_EQ(node_->state(), NodeState::quick_stop);
  tick_for(90);
  EXPECT_EQ(fake_->stops, 0);
  tick_for(20);
  EXPECT_EQ(node_->state(), NodeState::switch_on_disabled);
  EXPECT_EQ(node_->cause(), FaultCause::none);
  EXPECT_EQ(fake_->stops, 1);
}

TEST_F(StageNodeTest, WhatFailsOutsideStopsItToo) {
  measure();
  node_->fail(FaultCause::host_heartbeat);
  EXPECT_EQ(node_->state(), NodeState::fault_reaction);
  tick_for(120);
  EXPECT_EQ(node_->state(), NodeState::fault);
  EXPECT_EQ(node_->cause(), FaultCause::host_heartbeat);
}

TEST(StageNode, RefusesWhatDoesNotFit) {
  const auto make = [](const MotionControllerSpec& spec, const NodeOptions& options) {
    StageNode(std::make_unique<test::FakeStage>(2, 1, kRate_hz), {}, spec, {}, options);
  };
  EXPECT_NO_THROW(make(controller(), {}));
  MotionControllerSpec other = controller();
  other.actuator_decoupling = Eigen::MatrixXd::Ones(3, 1);
  EXPECT_THROW(make(other, {}), std::invalid_argument);
  EXPECT_THROW(make(controller(), {.watchdog_s = -1.0}), std::invalid_argument);
  EXPECT_THROW(make(controller(), {.hold_s = -1.0}), std::invalid_argument);
}

// A stage behind a bus equals one without: same seed, same run.
TEST(StageNode, GivesTheSamplesOfTheStageItself) {
  test::SimulatedSpec spec = test::small_stage_spec();
  spec.simulation.sensor_noise_m = 1e-9;
  spec.simulation.force_noise_n = 1e-3;
  MotionControllerSpec loop = controller();
  StageNode node(test::simulated(spec), {}, loop, {}, {});
  test::Bench bare(spec);
  ASSERT_TRUE(node.request(SupervisorCommand::enable).accepted);
  std::vector<double> y(1);
  Inputs inputs;
  inputs.y = y;
  for (int run = 0; run < 2; ++run) {
    node.begin_run(7, 0, inputs);
    bare.start(7);
    EXPECT_EQ(y, bare.y);
    for (std::uint64_t n = 0; n < 50; ++n) {
      bare.u = {std::sin(0.1 * static_cast<double>(n)), 0.2};
      ASSERT_EQ(node.advance(0, bare.u, inputs), Outcome::ok);
      ASSERT_EQ(bare.step(), Outcome::ok);
      ASSERT_EQ(y, bare.y) << n;
    }
    node.end_run();
    bare.stage().stop();
  }
}

}  // namespace stageid::test_stage_node
