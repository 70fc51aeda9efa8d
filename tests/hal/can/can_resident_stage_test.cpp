#include "hal/can/can_resident_stage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "hal/stage/motion_controller.hpp"
#include "tests/hal/can/can_rig.hpp"
#include "tests/hal/stage_bench.hpp"

namespace stageid::test_can_resident_stage {

using test::CanRig;

constexpr int kPeriod = 400;

/// Loses every n-th frame in both directions, of any kind.
class LossyCan final : public CanThrough {
 public:
  LossyCan(std::unique_ptr<CanTransport> inner, unsigned lost_of_hundred)
      : CanThrough(*inner), inner_(std::move(inner)), lost_of_hundred_(lost_of_hundred) {}
  std::size_t send(std::span<const CanFrame> frames) noexcept override {
    for (const CanFrame& frame : frames)
      if (!lost()) static_cast<void>(CanThrough::send({&frame, 1}));
    return frames.size();
  }
  std::size_t receive(std::span<CanFrame> frames) noexcept override {
    const std::size_t count = CanThrough::receive(frames);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i)
      if (!lost()) frames[kept++] = frames[i];
    return kept;
  }
  void cut() { lost_of_hundred_ = 100; }
  void mend() { lost_of_hundred_ = 0; }

 private:
  bool lost() {
    random_ = random_ * 6364136223846793005U + 1442695040888963407U;
    return (random_ >> 40) % 100 < lost_of_hundred_;
  }
  std::unique_ptr<CanTransport> inner_;
  unsigned lost_of_hundred_;
  std::uint64_t random_ = 1;
};

struct Rows {
  void operator()(std::span<const double> values, std::span<const Outcome> outcomes) {
    value.insert(value.end(), values.begin(), values.end());
    outcome.insert(outcome.end(), outcomes.begin(), outcomes.end());
  }
  std::vector<double> value;
  std::vector<Outcome> outcome;
};

Waveforms waveforms(int periods = 2) {
  Waveforms w;
  w.samples.setZero(kPeriod, 2);
  for (int n = 0; n < kPeriod; ++n)
    w.samples(n, 1) = 0.5 * std::sin(2.0 * M_PI * 7.0 * n / kPeriod);
  w.periods = periods;
  w.transient_periods = 1;
  return w;
}

test::SimulatedSpec noisy_stage() {
  test::SimulatedSpec spec = CanRig::quiet_stage();
  spec.simulation.sensor_noise_m = 1e-9;
  spec.simulation.force_noise_n = 1e-3;
  return spec;
}

JobProgress play(CanRig& rig, CanResidentStage& stage, std::uint64_t seed) {
  Trigger trigger;
  trigger.run_seed = seed;
  JobProgress progress = stage.arm(trigger);
  while (progress.status == JobStatus::running) {
    rig.serve_ms(1);
    progress = stage.poll();
  }
  return progress;
}

/// u = C(y) + r on the stage without bus: rows of u and y.
std::vector<double> expected_rows(const test::SimulatedSpec& spec, std::uint64_t seed) {
  test::Bench stage(spec);
  MotionController controller(spec.controller);
  const Waveforms w = waveforms();
  std::vector<double> rows;
  stage.start(seed);
  for (int n = 0; n < 3 * kPeriod; ++n) {
    controller.update(stage.y.data(), stage.u.data());
    // The waveform is transferred as float32.
    stage.u[1] += static_cast<double>(static_cast<float>(w.samples(n % kPeriod, 1)));
    rows.insert(rows.end(), {stage.u[0], stage.u[1], stage.y[0]});
    EXPECT_EQ(stage.step(), Outcome::ok);
  }
  return rows;
}

/// To half a unit of float32's last place.
void expect_rows(const std::vector<double>& rows, const std::vector<double>& expected) {
  ASSERT_EQ(rows.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_NEAR(rows[i], expected[i], 0x1p-24 * std::abs(expected[i]) + 1e-40) << i;
}

TEST(CanResidentStage, RecordsWhatTheLoopHereWouldHaveMeasured) {
  CanRig rig({}, noisy_stage());
  const auto stage = rig.resident();
  EXPECT_EQ(stage->upload(waveforms()).status, JobStatus::done);
  for (const std::uint64_t seed : {3U, 4U}) {
    if (seed == 4U) stage->upload(waveforms());
    ASSERT_EQ(play(rig, *stage, seed).status, JobStatus::done);
    Rows rows;
    EXPECT_EQ(stage->download(std::ref(rows)).done, 3U * kPeriod);
    expect_rows(rows.value, expected_rows(rig.stage_spec(), seed));
    EXPECT_THAT(rows.outcome, testing::Each(Outcome::ok));
  }
  EXPECT_EQ(rig.node().state(), NodeState::operation_enabled);
  stage->stop();
  EXPECT_EQ(rig.node().state(), NodeState::switch_on_disabled);
}

TEST(CanResidentStage, TransfersHealOnABusThatLosesAFifth) {
  CanRig rig({}, noisy_stage());
  CanResidentStage stage(rig.stage_spec().info, rig.spec(),
                         std::make_unique<LossyCan>(rig.host_bus(), 20), {});
  stage.upload(waveforms());
  ASSERT_EQ(play(rig, stage, 3).status, JobStatus::done);
  Rows rows;
  stage.download(std::ref(rows));
  expect_rows(rows.value, expected_rows(rig.stage_spec(), 3));
}

TEST(CanResidentStage, ATransferThatBrokeOffGoesOn) {
  CanRig rig;
  auto bus = std::make_unique<LossyCan>(rig.host_bus(), 0);
  LossyCan& wire = *bus;
  CanResidentStage stage(rig.stage_spec().info, rig.spec(), std::move(bus), {});
  stage.connect();
  wire.cut();
  EXPECT_THROW(stage.upload(waveforms()), StageError);
  wire.mend();
  EXPECT_EQ(stage.upload(waveforms()).status, JobStatus::done);
  ASSERT_EQ(play(rig, stage, 3).status, JobStatus::done);
  Rows rows;
  wire.cut();
  EXPECT_THROW(stage.download(std::ref(rows)), StageError);
  wire.mend();
  EXPECT_EQ(stage.download(std::ref(rows)).done, 3U * kPeriod);
  EXPECT_EQ(rows.outcome.size(), 3U * kPeriod);
}

TEST(CanResidentStage, ALimitEndsTheRunAndTheRowsUpToItAreThere) {
  test::SimulatedSpec spec = CanRig::quiet_stage();
  spec.limits.actuator_n[1] = 0.4;
  CanRig rig({}, spec);
  const auto stage = rig.resident();
  stage->upload(waveforms());
  const JobProgress progress = play(rig, *stage, 3);
  EXPECT_EQ(progress.status, JobStatus::failed);
  EXPECT_EQ(progress.outcome, Outcome::limit);
  EXPECT_THAT(progress.message, testing::HasSubstr("actuator a2: |u| would be 0.4"));
  Rows rows;
  stage->download(std::ref(rows));
  ASSERT_GT(rows.outcome.size(), 1U);
  EXPECT_GT(std::abs(rows.value[3 * (rows.outcome.size() - 1) + 1]), 0.4);
  rig.serve_ms(200);
  EXPECT_EQ(rig.node().state(), NodeState::fault);
}

TEST(CanResidentStage, ANodeWhoseHostFallsSilentStops) {
  CanRig rig;
  rig.boot();
  const auto stage = rig.resident();
  stage->upload(waveforms(5000));
  stage->arm({});
  rig.serve_ms(1000);
  EXPECT_EQ(rig.node().state(), NodeState::measuring);
  rig.serve_ms(2);
  EXPECT_EQ(rig.node().cause(), FaultCause::watchdog);
  rig.serve_ms(120);
  EXPECT_EQ(rig.node().state(), NodeState::fault);
}

TEST(CanResidentStage, RefusesWhatDoesNotFit) {
  CanRig rig;
  const auto stage = rig.resident();
  const auto refused = [&](void (*change)(Waveforms&)) {
    Waveforms w = waveforms();
    change(w);
    EXPECT_THROW(stage->upload(w), std::invalid_argument);
  };
  refused([](Waveforms& w) { w.samples.setZero(); });
  refused([](Waveforms& w) { w.samples.resize(0, 2); });
  refused([](Waveforms& w) { w.samples.conservativeResize(kPeriod, 1); });
  refused([](Waveforms& w) { w.samples(3, 0) = NAN; });
  refused([](Waveforms& w) { w.periods = 0; });
  refused([](Waveforms& w) { w.periods = 1 << 30; });
  EXPECT_THROW(stage->arm({}), StageError) << "nothing uploaded";
  stage->upload(waveforms());
  Trigger backwards;
  backwards.ramp_s = -1.0;
  EXPECT_THROW(stage->arm(backwards), std::invalid_argument);
  rig.freeze();
  EXPECT_THROW(stage->poll(), StageError);
  EXPECT_NO_THROW(stage->stop());
}

}  // namespace stageid::test_can_resident_stage
