#include "hal/can/can_stage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/hal/can/altered_can.hpp"
#include "tests/hal/can/can_host.hpp"
#include "tests/hal/stage_bench.hpp"

namespace stageid::test_can_stage {

using test::all_ok;
using test::CanRig;
using Host = test::CanHost;
using Running = test::RunningCanHost;
using Wire = test::CanRigOptions;

TEST(CanStage, GivesTheSamplesOfTheStageItselfButForRounding) {
  test::SimulatedSpec spec = CanRig::quiet_stage();
  spec.simulation.sensor_noise_m = 1e-9;
  spec.simulation.force_noise_n = 1e-3;
  CanRig rig({}, spec);
  Host host(rig);
  test::Bench bare(spec);
  for (const std::uint64_t seed : {7U, 8U}) {
    Host again(rig);
    again.start(seed);
    bare.start(seed);
    for (std::uint64_t n = 0; n < 300; ++n) {
      // The wire may change a measurement by at most half a count.
      ASSERT_NEAR(again.y()[0], bare.y[0], 0.5001 * 1.25e-3 / kCanCountsOfRange) << n;
      bare.u = {Host::command(n), -0.5 * Host::command(n)};
      ASSERT_EQ(again.exchange(), Outcome::ok);
      ASSERT_EQ(bare.step(), Outcome::ok);
    }
    again.stage().stop();
    EXPECT_EQ(rig.node().state(), NodeState::switch_on_disabled);
  }
  EXPECT_EQ(rig.front().rejected(), 0U);
}

TEST(CanStage, SequenceNumbersGoRound) {
  CanRig rig;
  Running host(rig);
  for (int n = 0; n < 70000; ++n) ASSERT_EQ(host.exchange(), Outcome::ok) << n;
  EXPECT_EQ(rig.node().sample(), 70000U);
}

TEST(CanStage, FourLostAnswersInARowAreStale) {
  CanRig rig(Wire{{}, {"lost@3x4"}});
  Running host(rig);
  EXPECT_THAT(host.exchange(4),
              testing::ElementsAre(Outcome::ok, Outcome::ok, Outcome::stale, Outcome::ok));
  EXPECT_EQ(host.stage().counts().repeats, 3U);
}

TEST(CanStage, AChannelWithoutAValueIsIncompleteOrStale) {
  test::SimulatedSpec spec = CanRig::quiet_stage();
  spec.simulation.faults = {{SimulationSpec::Fault::Kind::missed_cycle, 0, 2, 1, -1}};
  CanRig rig({}, spec);
  Running host(rig);
  EXPECT_THAT(host.exchange(4),
              testing::ElementsAre(Outcome::ok, Outcome::ok, Outcome::stale, Outcome::ok));
}

TEST(CanStage, ASetpointThatIsMissingOnOneBusMovesNothing) {
  // Frames are counted in turn: u[2] on the second bus is frame 5.
  CanRig rig(Wire{{"lost@5"}, {}, 2});
  Running host(rig, {1e3, false});
  std::vector<Outcome> expected = all_ok(6);
  expected[2] = Outcome::stale;
  EXPECT_EQ(host.exchange(6), expected);
  EXPECT_EQ(rig.node().sample(), 5U);
  host.stage().stop();
  EXPECT_EQ(host.stage().node().gaps, 1U);
}

TEST(CanStage, ALimitInTheNodeEndsTheRunForSafety) {
  test::SimulatedSpec spec = CanRig::quiet_stage();
  spec.limits.actuator_n[0] = 0.4;  // reached in cycle 2: 0.745 N sin 0.6
  CanRig rig({}, spec);
  Running host(rig);
  EXPECT_THAT(host.exchange(4),
              testing::ElementsAre(Outcome::ok, Outcome::ok, Outcome::limit, Outcome::limit));
  EXPECT_THAT(
      host.stage().trouble(),
      testing::HasSubstr("fault reaction: actuator a1: |u| would be 0.4207 N, limit 0.4 N"));
  rig.serve_ms(200);
  EXPECT_EQ(rig.node().state(), NodeState::fault);
  host.stage().stop();
}

TEST(CanStage, AHostThatFallsSilentIsStoppedUntilAnExplicitReset) {
  CanRig rig;
  Running host(rig);
  host.exchange(5);
  rig.serve_ms(20);
  EXPECT_EQ(rig.node().state(), NodeState::measuring);
  rig.serve_ms(2);
  EXPECT_EQ(rig.node().state(), NodeState::fault_reaction);
  EXPECT_EQ(host.exchange(), Outcome::fault);
  EXPECT_THAT(host.stage().trouble(), testing::HasSubstr("the host stopped sending"));
  rig.serve_ms(110);
  ASSERT_EQ(rig.node().state(), NodeState::fault);
  EXPECT_THAT([&] { Host(rig).start(); },
              testing::ThrowsMessage<StageError>(
                  "can: pair0: the node is in fault (the host stopped sending); remove the cause "
                  "and add --reset-fault"));
  Host resetting(rig, {0.0, true});
  resetting.start();
  EXPECT_EQ(resetting.exchange(), Outcome::ok);
}

// A busy machine may stop the node between two looks at the bus.
TEST(CanStage, ADelayOfTheNodeIsNotTheSilenceOfItsHost) {
  CanRig rig;
  test::AlteredCan slow(rig.pair().node(), [&](std::span<CanFrame>, std::size_t count) {
    rig.pair().pass_time(10 * 20'000'000);  // watchdogs
    return count;
  });
  CanNode front(rig.node(), rig.layout(), slow);
  std::vector<double> y(1);
  Inputs first;
  first.y = y;
  ASSERT_TRUE(rig.node().request(SupervisorCommand::enable).accepted);
  static_cast<void>(rig.node().begin_run(3, slow.now_ns(), first));
  front.serve(0);
  EXPECT_EQ(rig.node().state(), NodeState::measuring) << "the host may have sent meanwhile";
  front.serve(0);
  EXPECT_EQ(rig.node().state(), NodeState::fault_reaction) << "it has not";
}

TEST(CanStage, ANodeThatFreezesIsStaleAndOneThatRestartsAFault) {
  CanRig rig;
  Running host(rig);
  host.exchange(5);
  rig.freeze();
  const std::int64_t before_ns = rig.pair().now_ns();
  EXPECT_EQ(host.exchange(), Outcome::stale);
  EXPECT_EQ(rig.pair().now_ns() - before_ns, 4 * 5'000'000) << "four times reply_timeout_s";
  EXPECT_THAT(host.stage().trouble(), testing::HasSubstr("did not answer sample 6"));
  rig.boot();
  EXPECT_EQ(host.exchange(), Outcome::fault);
  EXPECT_THAT(host.stage().trouble(), testing::HasSubstr("the node was restarted"));
  EXPECT_EQ(rig.node().sample(), 0U);
}

TEST(CanStage, TheStateOfTheBusIsAnOutcome) {
  const auto with = [](CanBusState state, const char* text) {
    CanRig rig(Wire{{}, {}, 2});
    Running host(rig);
    host.exchange(3);
    rig.pair().set_state(1, state);
    const Outcome outcome = host.exchange();
    if (outcome != Outcome::ok) {
      EXPECT_EQ(host.stage().trouble(), text);
    }
    rig.pair().set_state(1, CanBusState::active);
    rig.serve_ms(5);
    return outcome;
  };
  EXPECT_EQ(with(CanBusState::warning, ""), Outcome::ok);
  EXPECT_EQ(with(CanBusState::passive, "pair1: error passive"), Outcome::bus_passive);
  EXPECT_EQ(with(CanBusState::off, "pair1: bus off"), Outcome::bus_off);
  EXPECT_EQ(with(CanBusState::down, "pair1: interface down"), Outcome::link_down);
}

TEST(CanStage, ANodeWhoseBusIsOffStopsByItself) {
  CanRig rig;
  Running host(rig);
  host.exchange(3);
  rig.pair().set_state(0, CanBusState::off);
  rig.serve_ms(1);
  EXPECT_EQ(rig.node().cause(), FaultCause::bus_off);
  rig.serve_ms(120);
  EXPECT_EQ(rig.node().state(), NodeState::fault);
}

TEST(CanStage, StartRefusesInWords) {
  CanRig rig;
  rig.freeze();
  const auto start = [&] { Host(rig).start(); };
  EXPECT_THAT(start, test::refuses("can: pair0: no node answered within 600 ms"));
  rig.pair().set_state(0, CanBusState::off);
  EXPECT_THAT(start, test::refuses("can: pair0: bus off"));
  rig.pair().set_state(0, CanBusState::active);
  rig.thaw();
  NodePanel open;
  open.interlock_closed = false;
  rig.node().set_panel(open);
  EXPECT_THAT(start, testing::ThrowsMessage<StageError>(
                         "can: pair0: the node refused the command: the interlock is open; close "
                         "it"));
}

TEST(CanStage, ARunStartsThoughItsFirstFramesAreLost) {
  CanRig rig(Wire{{}, {"lost@0x2"}});
  Running host(rig);
  EXPECT_THAT(host.exchange(3), testing::ElementsAreArray(all_ok(3)));
  CanRig deaf(Wire{{}, {"lost@0x3"}});
  Host unlucky(deaf);
  EXPECT_THROW(unlucky.start(), StageError);
  EXPECT_EQ(deaf.node().state(), NodeState::switch_on_disabled);
}

TEST(CanStage, WhatTheWireCannotCarryStopsTheRun) {
  CanRig rig;
  const auto stage = rig.host();
  test::Driver host(*stage);
  host.start();
  host.u[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(host.step(), Outcome::fault);
  host.u[0] = 100.0;
  EXPECT_EQ(host.step(), Outcome::fault);
  EXPECT_EQ(stage->counts().saturated, 1U);
  EXPECT_THAT(stage->trouble(), testing::HasSubstr("exceeds actuator_range_n"));
  host.u.clear();
  EXPECT_EQ(host.step(), Outcome::fault);
  EXPECT_EQ(rig.node().sample(), 0U) << "no other value instead";
}

}  // namespace stageid::test_can_stage
