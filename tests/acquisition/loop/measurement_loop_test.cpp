#include "acquisition/loop/measurement_loop.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "tests/acquisition/loop/measurement_loop_fixture.hpp"
#include "tests/support/process/heap_use.hpp"
#include "tests/support/stages/analytic_stage.hpp"

namespace stageid::test_measurement_loop {

using namespace test::measurement_loop;
using test::AnalyticStage;

TEST_F(MeasurementLoopTest, RecordsTheEquationsOfTheLoop) {
  MeasurementLoop loop = make_loop();
  loop.start(42, excitation_);
  run(loop);
  EXPECT_TRUE(loop.complete());
  EXPECT_EQ(loop.reason(), StopReason::none);
  EXPECT_EQ(stage_.seeds(), std::vector<std::uint64_t>{42});
  EXPECT_EQ(stage_.stops(), 1);

  const std::vector<Row> all = rows();
  ASSERT_EQ(all.size(), kSamples);
  EXPECT_TRUE(marked(all).empty());
  const std::vector<Eigen::VectorXd> control = controls(all);
  EXPECT_TRUE(all[0].y.isZero(0.0));
  for (std::size_t n = 0; n < kSamples; ++n) {
    ASSERT_EQ(all[n].u, control[n] + excitation_at(n)) << "u[n] = C(y[n]) + r[n], n = " << n;
    if (n + 1 == kSamples) break;
    for (Eigen::Index i = 0; i < kSensors; ++i) {
      double y = AnalyticStage::kPole * all[n].y[i];
      for (Eigen::Index j = 0; j < kActuators; ++j)
        y += AnalyticStage::input_gain(i, j) * all[n].u[j];
      // One rounding may be fused differently; without the loop's delay, the error would be some percent.
      ASSERT_NEAR(all[n + 1].y[i], y, 1e-15 + 1e-14 * std::abs(y)) << "y[n+1] = P(y[n], u[n])";
    }
  }
  EXPECT_GT(control[kSamples - 1].norm(), 1e-6) << "the controller does something";
  EXPECT_EQ(loop.health().cycles, kSamples);
  EXPECT_EQ(loop.health().marked, 0U);
}

TEST_F(MeasurementLoopTest, AGoodRunRampsDownBehindItsRecord) {
  perform({.ramp_s = 0.01});  // 10 samples
  ASSERT_EQ(stage_.exchanges(), kSamples + 10);
  EXPECT_EQ(rows().size(), kSamples);
  // Actuator 2 has the ramp of the period, offset 1, times the gain; its control part is small.
  const std::vector<double>& sent = stage_.sent();
  for (std::uint64_t k = 0; k < 10; ++k) {
    const double gain = static_cast<double>(10 - k) / 11.0;
    const double r = excitation_at(kSamples + k)[2];
    EXPECT_NEAR(sent[(kSamples + k) * kActuators + 2], gain * r, 0.05 * excitation_at(19)[2]);
  }
}

TEST_F(MeasurementLoopTest, TheSameSeedAndExcitationGiveTheSameBits) {
  stage_.noise = 1e-3;
  MeasurementLoop loop = make_loop();
  std::vector<std::vector<double>> runs;
  for (int repeat = 0; repeat < 2; ++repeat) {
    loop.start(9, excitation_);
    run(loop);
    const auto words = ring_.front(kSamples);
    runs.emplace_back(words.begin(), words.end());
    ring_.pop(kSamples);
  }
  EXPECT_EQ(runs[0], runs[1]);
}

TEST_F(MeasurementLoopTest, AStepDoesNotAllocate) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "malloc is not ours in this build";
  // Everything that can happen in a run: lateness, gaps, a non-finite value, a limit and its ramp.
  stage_.outcomes = {{3, Outcome::late}, {5, Outcome::stale}, {8, Outcome::incomplete}};
  stage_.valid = {{8, 1}};
  stage_.first_sensor = {{11, std::numeric_limits<double>::quiet_NaN()}};
  for (std::uint64_t n = 40; n < 100; ++n) stage_.outcomes[n] = Outcome::limit;
  MeasurementLoop loop = make_loop();
  loop.start(1, excitation_);
  std::uint64_t allocations = 0;
  {
    const test::AllocationCounter counter;
    run(loop);
    allocations = counter.count();
  }
  EXPECT_EQ(loop.reason(), StopReason::limit);
  EXPECT_EQ(allocations, 0U);
}

TEST_F(MeasurementLoopTest, ALimitRampsDownInClosedLoopAndMarksTheRamp) {
  script(25, 200, Outcome::limit);
  MeasurementLoop& loop = perform();
  EXPECT_EQ(loop.reason(), StopReason::limit);
  EXPECT_FALSE(loop.complete());
  EXPECT_EQ(stage_.stops(), 1);
  const std::vector<Row> all = rows();
  // The command of row 25 was replaced; 10 rows of the ramp follow.
  ASSERT_EQ(all.size(), 26U + 10);
  for (std::size_t n = 0; n < all.size(); ++n) EXPECT_EQ(all[n].status.marked, n >= 25) << n;
  const std::vector<Eigen::VectorXd> control = controls(all);
  for (std::size_t n = 0; n < all.size(); ++n) {
    const double gain = n <= 25 ? 1.0 : static_cast<double>(36 - n) / 11.0;
    const Eigen::VectorXd r = all[n].u - control[n];
    EXPECT_LT((r - gain * excitation_at(n)).norm(), 1e-12 * 20.0) << n;
  }
  EXPECT_EQ(loop.health().marked, 11U);
}

TEST_F(MeasurementLoopTest, AFaultEndsTheRunAtOnce) {
  for (const Outcome outcome : {Outcome::fault, Outcome::bus_off, Outcome::link_down}) {
    stage_.outcomes = {{25, outcome}};
    const int stops = stage_.stops();
    MeasurementLoop& loop = perform();
    EXPECT_EQ(loop.reason(), StopReason::fault);
    EXPECT_EQ(loop.last_trouble(), outcome);
    EXPECT_FALSE(loop.complete());
    EXPECT_EQ(stage_.exchanges(), 26U) << "nothing is sent any more";
    EXPECT_EQ(stage_.stops(), stops + 1);
    EXPECT_EQ(marked(rows()), std::set<std::size_t>{25});
    EXPECT_EQ(loop.step(), LoopStatus::ended);
  }
}

// If measurement 26 is missing, command 25 may not have arrived. A late sample is valid, also on an error-passive bus.
TEST_F(MeasurementLoopTest, AMissingMeasurementIsHeldAndMarkedALateOneMarked) {
  stage_.lateness_ns = 12345;
  for (const Outcome outcome :
       {Outcome::stale, Outcome::corrupt, Outcome::late, Outcome::bus_passive}) {
    SCOPED_TRACE(to_string(outcome));
    const bool missing = outcome == Outcome::stale || outcome == Outcome::corrupt;
    const bool late = outcome == Outcome::late;
    stage_.outcomes = {{25, outcome}, {40, outcome}};
    MeasurementLoop& loop = perform();
    EXPECT_TRUE(loop.complete());
    const std::vector<Row> all = rows();
    EXPECT_EQ(marked(all),
              missing ? std::set<std::size_t>({25, 26, 40, 41}) : std::set<std::size_t>({26, 41}));
    EXPECT_EQ(all[26].y == all[25].y, missing);
    EXPECT_EQ(all[26].status.outcome, static_cast<std::uint8_t>(outcome));
    EXPECT_EQ(loop.health().missing, missing ? 2U : 0U);
    EXPECT_EQ(loop.health().late, late ? 2U : 0U);
    EXPECT_EQ(loop.health().marked, missing ? 4U : 2U);
    EXPECT_EQ(all[26].status.lateness_ns, late ? 12345U : 0U);
    EXPECT_EQ(loop.health().largest_lateness_ns, late ? 12345 : 0);
  }
}

TEST_F(MeasurementLoopTest, OnlyTheMissingSensorIsHeld) {
  stage_.outcomes = {{25, Outcome::incomplete}};
  stage_.valid = {{25, 0b10}};
  perform();
  const std::vector<Row> all = rows();
  EXPECT_EQ(all[26].y[0], all[25].y[0]);
  EXPECT_NE(all[26].y[1], all[25].y[1]);
  EXPECT_TRUE(all[26].status.marked);
}

TEST_F(MeasurementLoopTest, AValueThatIsNoNumberNeitherReachesControllerNorLog) {
  stage_.first_sensor = {{25, std::numeric_limits<double>::quiet_NaN()},
                         {40, std::numeric_limits<double>::infinity()}};
  MeasurementLoop& loop = perform();
  const std::vector<Row> all = rows();
  ASSERT_EQ(all.size(), kSamples);
  for (const Row& row : all) ASSERT_TRUE(row.u.allFinite() && row.y.allFinite());
  EXPECT_EQ(all[26].y[0], all[25].y[0]);
  EXPECT_TRUE(all[26].status.marked);
  EXPECT_TRUE(all[41].status.marked);
  EXPECT_EQ(loop.health().missing, 2U);
}

TEST_F(MeasurementLoopTest, ACommandThatIsNoNumberIsSentToBeRefusedButNotLogged) {
  stage_.first_sensor = {{25, 1e308}};
  controller_ = MotionController(test::analytic_controller(stage_.info(), 1e6));
  perform();
  EXPECT_FALSE(std::isfinite(stage_.sent()[26 * kActuators]));
  for (const Row& row : rows()) ASSERT_TRUE(row.u.allFinite());
  EXPECT_TRUE(rows()[26].status.marked);
}

// Bucket of 10: k consecutive misses add 2 k, so the sixth exceeds it.
TEST_F(MeasurementLoopTest, TheBucketForgivesFiveMissesInARowAndNotSix) {
  for (const std::uint64_t misses : {5U, 6U}) {
    script(20, 20 + misses, Outcome::stale);
    MeasurementLoop& loop = perform({.ramp_s = 0.01, .misses_allowed = 10});
    EXPECT_EQ(loop.complete(), misses == 5);
    EXPECT_EQ(loop.reason(), misses == 5 ? StopReason::none : StopReason::misses);
    EXPECT_EQ(rows().size(), misses == 5 ? kSamples : 26 + 10);
  }
}

// Every third cycle missed: +2 -1 -1 = 0. Every second: +1 per two cycles, full after 20.
TEST_F(MeasurementLoopTest, TheBucketLeaks) {
  for (const std::uint64_t every : {3U, 2U}) {
    script(0, kSamples, Outcome::stale, every);
    EXPECT_EQ(perform().complete(), every == 3);
  }
}

TEST_F(MeasurementLoopTest, AStageThatDoesNotAnswerInTheRampIsStoppedAtOnce) {
  script(20, 1000, Outcome::stale);
  MeasurementLoop& loop = perform({.ramp_s = 0.1});  // 100 samples
  EXPECT_EQ(loop.reason(), StopReason::misses);
  EXPECT_EQ(stage_.exchanges(), 20U + 6 + 6);
  EXPECT_EQ(stage_.stops(), 1);
}

TEST_F(MeasurementLoopTest, AnInterruptRampsDownAndMarks) {
  MeasurementLoop loop = make_loop();
  loop.start(1, excitation_);
  for (int n = 0; n < 15; ++n) ASSERT_EQ(loop.step(), LoopStatus::running);
  loop.request_stop(StopReason::interrupt);
  loop.request_stop(StopReason::log);  // ignored: the first reason counts
  run(loop);
  EXPECT_EQ(loop.reason(), StopReason::interrupt);
  EXPECT_FALSE(loop.complete());
  const std::vector<Row> all = rows();
  ASSERT_EQ(all.size(), 15U + 11);
  for (std::size_t n = 0; n < all.size(); ++n) EXPECT_EQ(all[n].status.marked, n >= 15);
}

TEST_F(MeasurementLoopTest, AFullRingStopsNothingHalfWay) {
  SampleRing small(kActuators + kSensors + 1, 8);
  MeasurementLoop loop(stage_, controller_, small, {.ramp_s = 0.01});
  loop.start(1, excitation_);
  for (int n = 0; n < 8; ++n) ASSERT_EQ(loop.step(), LoopStatus::running);
  for (int n = 0; n < 3; ++n) ASSERT_EQ(loop.step(), LoopStatus::ring_full);
  EXPECT_EQ(stage_.exchanges(), 8U);
  small.pop(8);
  EXPECT_EQ(loop.step(), LoopStatus::running);
  // The log has failed: the ramp continues without it.
  loop.request_stop(StopReason::log);
  run(loop);
  EXPECT_EQ(loop.reason(), StopReason::log);
  EXPECT_EQ(small.pushed(), 9U);
  EXPECT_EQ(stage_.exchanges(), 9U + 11);
  EXPECT_EQ(stage_.stops(), 1);
}

TEST_F(MeasurementLoopTest, ALimitOrAFaultInTheRampBehindAGoodRunIsTold) {
  for (const auto& [outcome, reason] : {std::pair(Outcome::limit, StopReason::limit),
                                        std::pair(Outcome::fault, StopReason::fault)}) {
    script(kSamples + 3, 200, outcome);
    MeasurementLoop& loop = perform();
    EXPECT_TRUE(loop.complete());
    EXPECT_EQ(loop.reason(), reason);
    EXPECT_EQ(loop.last_trouble(), outcome);
    EXPECT_TRUE(marked(rows()).empty());
  }
}

TEST_F(MeasurementLoopTest, AStageThatBrakesIsWaitedForAndThenStopped) {
  script(25, 60, Outcome::braking);
  stage_.outcomes[60] = Outcome::opened;
  MeasurementLoop& loop = perform({.ramp_s = 0.01});  // 10 samples: the brake takes longer
  EXPECT_EQ(loop.reason(), StopReason::limit);
  EXPECT_EQ(stage_.exchanges(), 61U);
  EXPECT_EQ(stage_.stops(), 1);
  const std::vector<Row> all = rows();
  ASSERT_EQ(all.size(), 61U);
  for (std::size_t n = 0; n < all.size(); ++n) EXPECT_EQ(all[n].status.marked, n >= 25) << n;
}

// A replay ends with its record.
TEST_F(MeasurementLoopTest, AStageThatIsGoneBehindAGoodRunSpoilsNothing) {
  stage_.outcomes = {{kSamples, Outcome::link_down}};
  MeasurementLoop& loop = perform();
  EXPECT_TRUE(loop.complete());
  EXPECT_EQ(loop.reason(), StopReason::none);
  EXPECT_EQ(loop.health().missing, 0U);
}

// y[1] is due before sample 2. A slowed stage is late by its own periods.
TEST_F(MeasurementLoopTest, DeadlinesAreForTheWallClockOnly) {
  const auto expect = [&](Clock clock, double pace, const std::vector<std::int64_t>& deadlines_ns) {
    AnalyticStage stage(kActuators, kSensors, 1000.0, clock, pace);
    MeasurementLoop loop(stage, controller_, ring_);
    loop.start(1, excitation_);
    for (const std::int64_t deadline_ns : deadlines_ns) {
      static_cast<void>(loop.step());
      EXPECT_EQ(stage.last_deadline_ns(), deadline_ns);
    }
  };
  expect(Clock::virtual_time, 1.0, {0});
  expect(Clock::wall, 1.0, {2'000'000, 3'000'000});
  expect(Clock::wall, 0.1, {20'000'000});
}

/// Commands as the stage received them since the loop was closed.
Eigen::VectorXd sent_at(const test::AnalyticStage& stage, std::size_t n) {
  return Eigen::Map<const Eigen::VectorXd>(stage.sent().data() + n * kActuators, kActuators);
}

constexpr LoopOptions kHold = {.ramp_s = 0.01, .between_runs = BetweenRuns::hold};

TEST_F(MeasurementLoopTest, HeldBetweenRunsTheLoopIsNeverOpened) {
  MeasurementLoop& loop = perform(kHold);
  EXPECT_TRUE(loop.holding());
  EXPECT_TRUE(loop.complete());
  for (int n = 0; n < 7; ++n) EXPECT_EQ(loop.step(), LoopStatus::held);
  PreparedExcitation prepared = loop.prepare(excitation_);
  loop.next(prepared);
  EXPECT_FALSE(loop.complete());
  run(loop);
  EXPECT_TRUE(loop.holding());
  EXPECT_EQ(stage_.seeds().size(), 1U);
  EXPECT_EQ(stage_.stops(), 0);
  EXPECT_EQ(loop.health().cycles, kSamples);
  loop.release();
  EXPECT_EQ(stage_.stops(), 1);
  EXPECT_EQ(loop.reason(), StopReason::none);
  EXPECT_TRUE(loop.ended());
  // Both records begin at the start of the period, at full level, without marks.
  const std::vector<Row> all = rows();
  ASSERT_EQ(all.size(), 2 * kSamples);
  EXPECT_TRUE(marked(all).empty());
  // 10 leading samples, the run, 10 of the landing, 7 held, 10 leading samples.
  const std::size_t second = 10 + kSamples + 10 + 7 + 10;
  for (std::size_t n = 0; n < kSamples; ++n) {
    EXPECT_EQ(all[n].u, sent_at(stage_, 10 + n)) << n;
    EXPECT_EQ(all[kSamples + n].u, sent_at(stage_, second + n)) << n;
  }
}

// In and out of a run, r rises and falls in equal steps and continues its phase.
TEST_F(MeasurementLoopTest, AHeldStageIsHandedOverWithoutAStep) {
  excitation_.period.setZero();
  excitation_.period.col(0).setOnes();  // so that any step is one of the gain
  MeasurementLoop& loop = perform(kHold);
  for (int n = 0; n < 5; ++n) static_cast<void>(loop.step());
  PreparedExcitation prepared = loop.prepare(excitation_);
  loop.next(prepared);
  run(loop);
  MotionController again(test::analytic_controller(stage_.info()));
  Eigen::VectorXd y = Eigen::VectorXd::Zero(kSensors);
  Eigen::VectorXd control(kActuators);
  double last = 0.0;
  double largest = 0.0;
  for (std::size_t n = 0; n < stage_.exchanges(); ++n) {
    again.update(y.data(), control.data());
    const Eigen::VectorXd u = sent_at(stage_, n);
    const double r = (u - control)[2];
    largest = std::max(largest, std::abs(r - last));
    last = r;
    for (Eigen::Index i = 0; i < kSensors; ++i) {
      y[i] *= test::AnalyticStage::kPole;
      for (Eigen::Index j = 0; j < kActuators; ++j)
        y[i] += test::AnalyticStage::input_gain(i, j) * u[j];
    }
  }
  EXPECT_NEAR(largest, 1.0 / 11.0, 1e-12);
}

TEST_F(MeasurementLoopTest, TheSameReasonsStopAHeldStage) {
  for (const auto& [outcome, reason] :
       {std::pair(Outcome::limit, StopReason::limit), std::pair(Outcome::fault, StopReason::fault),
        std::pair(Outcome::link_down, StopReason::fault)}) {
    const int stops = stage_.stops();
    stage_.outcomes = {{100, outcome}};
    MeasurementLoop& loop = perform(kHold);
    ASSERT_TRUE(loop.holding());
    LoopStatus status = LoopStatus::held;
    for (int n = 0; n < 40 && status != LoopStatus::ended; ++n) status = loop.step();
    EXPECT_EQ(status, LoopStatus::ended);
    EXPECT_EQ(loop.reason(), reason);
    EXPECT_TRUE(loop.complete());
    EXPECT_EQ(stage_.stops(), stops + 1);
    EXPECT_EQ(stage_.exchanges(), 101U);
  }
}

TEST_F(MeasurementLoopTest, MissesAndAnInterruptStopAHeldStage) {
  script(90, 1000, Outcome::stale);
  MeasurementLoop& loop = perform(kHold);
  while (loop.step() != LoopStatus::ended) {
  }
  EXPECT_EQ(loop.reason(), StopReason::misses);

  ring_.pop(rows().size());
  stage_.outcomes.clear();
  loop.start(1, excitation_);
  run(loop);
  loop.request_stop(StopReason::interrupt);
  EXPECT_EQ(loop.step(), LoopStatus::ended);
  EXPECT_EQ(loop.reason(), StopReason::interrupt);
  EXPECT_EQ(stage_.stops(), 2);
  EXPECT_EQ(rows().size(), kSamples);
}

TEST_F(MeasurementLoopTest, AStopBeforeTheFirstSampleRecordsNothing) {
  MeasurementLoop loop = make_loop(kHold);
  loop.start(1, excitation_);
  for (int n = 0; n < 5; ++n) static_cast<void>(loop.step());
  loop.request_stop(StopReason::interrupt);
  while (loop.step() != LoopStatus::ended) {
  }
  EXPECT_EQ(loop.reason(), StopReason::interrupt);
  EXPECT_FALSE(loop.complete());
  EXPECT_TRUE(rows().empty());
  EXPECT_EQ(loop.health().cycles, 0U);
}

TEST_F(MeasurementLoopTest, HoldingAndTheNextRunDoNotAllocate) {
  if (!test::AllocationCounter::works()) GTEST_SKIP() << "malloc is not ours in this build";
  MeasurementLoop& loop = perform(kHold);
  PreparedExcitation prepared = loop.prepare(excitation_);
  std::uint64_t allocations = 0;
  {
    const test::AllocationCounter counter;
    for (int n = 0; n < 20; ++n) static_cast<void>(loop.step());
    loop.next(prepared);
    run(loop);
    for (int n = 0; n < 20; ++n) static_cast<void>(loop.step());
    allocations = counter.count();
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_TRUE(loop.complete());
}

// The forces of the feed-forward are there before the excitation begins.
TEST_F(MeasurementLoopTest, AFeedForwardRisesBeforeTheRecord) {
  MotionControllerSpec spec = test::analytic_controller(stage_.info());
  spec.feed_forward_n = Eigen::Vector3d(5.0, 0.0, -2.0);
  spec.feed_forward_ramp_s = 0.02;
  MotionController controller(spec);
  for (const BetweenRuns between : {BetweenRuns::release, BetweenRuns::hold}) {
    MeasurementLoop loop(stage_, controller, ring_, {.ramp_s = 0.01, .between_runs = between});
    loop.start(1, excitation_);
    run(loop);
    const std::vector<Row> all = rows();
    ASSERT_EQ(all.size(), kSamples);
    const std::size_t lead = between == BetweenRuns::hold ? 21 + 10 : 21;
    EXPECT_LT(sent_at(stage_, 0).norm(), 0.3);
    EXPECT_EQ(all[0].u, sent_at(stage_, lead));
    for (std::size_t n = 0; n < kSamples; ++n) EXPECT_EQ(all[n].u, sent_at(stage_, lead + n)) << n;
    ring_.pop(all.size());
  }
}

TEST(StopReasonNames, EveryReasonHasItsOwn) {
  std::set<std::string> names;
  for (const StopReason reason :
       {StopReason::none, StopReason::limit, StopReason::fault, StopReason::misses,
        StopReason::interrupt, StopReason::log, StopReason::plant})
    EXPECT_TRUE(names.insert(to_string(reason)).second) << to_string(reason);
  EXPECT_TRUE(names.contains("plant"));
}

TEST_F(MeasurementLoopTest, RefusesWhatDoesNotFit) {
  EXPECT_THROW(make_loop({.ramp_s = -1.0}), std::invalid_argument);
  EXPECT_THROW(make_loop({.ramp_s = std::numeric_limits<double>::quiet_NaN()}),
               std::invalid_argument);
  EXPECT_THROW(make_loop({.misses_allowed = -1}), std::invalid_argument);
  SampleRing narrow(kActuators + kSensors, 8);
  EXPECT_THROW(MeasurementLoop(stage_, controller_, narrow), std::invalid_argument);
  AnalyticStage other(kActuators + 1, kSensors);
  EXPECT_THROW(MeasurementLoop(other, controller_, ring_), std::invalid_argument);

  MeasurementLoop loop = make_loop();
  const auto refused = [&](auto spoil) {
    LoopExcitation bad = excitation_;
    spoil(bad);
    EXPECT_THROW(loop.start(1, bad), std::invalid_argument);
  };
  refused([](LoopExcitation& e) { e.samples = 0; });
  refused([](LoopExcitation& e) { e.actuators.pop_back(); });
  refused([](LoopExcitation& e) { e.actuators[0] = kActuators; });
  refused([](LoopExcitation& e) { e.actuators[0] = -1; });
  refused([](LoopExcitation& e) { e.period(0, 0) = std::nan(""); });
  refused([](LoopExcitation& e) { e.period.resize(0, 3); });
  EXPECT_TRUE(stage_.seeds().empty()) << "the stage was not started";
  stage_.refuse_run = 0;
  EXPECT_THROW(loop.start(1, excitation_), StageError);
  EXPECT_EQ(loop.step(), LoopStatus::ended);
}

}  // namespace stageid::test_measurement_loop
