// Samples whose instant deviates from the followed clock are marked; the stamps are in the rows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <map>
#include <set>
#include <vector>

#include "acquisition/loop/measurement_loop.hpp"
#include "tests/support/stages/analytic_stage.hpp"

namespace stageid::test_measurement_loop_instants {

constexpr std::int64_t kPeriod_ns = 1'000'000;
constexpr std::int64_t kDelay_ns = 300'000;  // from the instant of the setpoint to the arrival
constexpr std::int64_t kNode_ns = 77'000'000'000;
constexpr std::uint64_t kSamples = 200;
constexpr double kJitter_s = 20e-6;

/// A stage on the wall clock, whose time is a script.
class StampedStage final : public CyclicStage {
 public:
  explicit StampedStage(bool sets_pace = false) : info_(plant_.info()) {
    info_.stamps = true;
    info_.sets_pace = sets_pace;
  }
  std::map<std::uint64_t, std::int64_t> deviation_ns;  ///< of y[n] from its instant

  const StageInfo& info() const noexcept override { return info_; }
  void start(std::uint64_t seed, Inputs& first) override {
    plant_.start(seed, first);
    first.t_sample_ns = first.t_rx_ns = 0;
  }
  Outcome exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept override {
    const Outcome outcome = plant_.exchange(outputs, inputs, deadline);
    const auto cycle = static_cast<std::int64_t>(inputs.cycle);
    std::int64_t late_ns = 0;
    if (const auto found = deviation_ns.find(inputs.cycle); found != deviation_ns.end())
      late_ns = found->second;
    inputs.t_sample_ns = inputs.t_rx_ns = cycle * kPeriod_ns;
    inputs.t_arrival_ns = (cycle - 1) * kPeriod_ns + kDelay_ns + late_ns;
    inputs.stamp_ns = kNode_ns + cycle * kPeriod_ns + late_ns;
    inputs.stamp_of_stage = true;
    return outcome;
  }
  void stop() noexcept override { plant_.stop(); }

 private:
  test::AnalyticStage plant_{1, 1, 1e3, Clock::wall};
  StageInfo info_;
};

SampleStamp unpack_stamp(std::uint64_t word) {
  SampleStamp stamp{static_cast<std::uint32_t>(word), {}};
  if (((word >> 32) & 1U) != 0) stamp.node_us = static_cast<std::uint16_t>(word >> 48);
  return stamp;
}

struct Row {
  SampleStatus status;
  SampleStamp stamp;
};

std::vector<Row> run(StampedStage& stage, double jitter_s, RunHealth* health = nullptr,
                     double rms_s = 0.0) {
  MotionController controller(test::analytic_controller(stage.info()));
  SampleRing ring(4, 1024);
  MeasurementLoop loop(stage, controller, ring,
                       {.ramp_s = 0.0, .jitter_s = jitter_s, .jitter_rms_s = rms_s});
  loop.start(1, {Eigen::MatrixXd::Constant(10, 1, 1.0), {0}, kSamples});
  while (loop.step() == LoopStatus::running) {
  }
  EXPECT_EQ(loop.reason(), StopReason::none);
  if (health != nullptr) *health = loop.health();
  std::vector<Row> rows;
  const auto words = ring.front(ring.capacity_rows());
  for (std::size_t at = 0; at < words.size(); at += 4)
    rows.push_back({unpack_status(std::bit_cast<std::uint64_t>(words[at + 3])),
                    unpack_stamp(std::bit_cast<std::uint64_t>(words[at + 2]))});
  return rows;
}

std::set<std::size_t> marked(const std::vector<Row>& rows) {
  std::set<std::size_t> found;
  for (std::size_t n = 0; n < rows.size(); ++n)
    if (rows[n].status.marked) found.insert(n);
  return found;
}

TEST(MeasurementLoopInstants, ASampleOffItsInstantIsMarkedAndTheRunGoesOn) {
  StampedStage stage;
  stage.deviation_ns = {{50, 21'000}, {80, -25'000}, {90, 19'000}};
  RunHealth health;
  const std::vector<Row> rows = run(stage, kJitter_s, &health);
  EXPECT_THAT(marked(rows), testing::ElementsAre(50, 80));
  EXPECT_TRUE(rows[50].status.irregular);
  EXPECT_EQ(rows[50].status.outcome, 0) << "the measurement itself is good";
  EXPECT_EQ(health.irregular, 2U);
  EXPECT_EQ(health.marked, 2U);
  EXPECT_EQ(health.late, 0U);
}

TEST(MeasurementLoopInstants, WithoutALimitNothingIsMarked) {
  StampedStage stage;
  stage.deviation_ns = {{50, 900'000}};
  EXPECT_THAT(marked(run(stage, 0.0)), testing::IsEmpty());
}

// 20 us rms in 200 samples: three of 160 us exceed it, also for -160 us, but not samples below 20 us.
TEST(MeasurementLoopInstants, AFewLateSamplesAreGoodIfTheRunIs) {
  StampedStage stage;
  stage.deviation_ns = {
      {50, 160'000}, {70, -160'000}, {90, 160'000}, {100, 160'000}, {110, -160'000}};
  for (std::uint64_t n = 130; n < 190; ++n) stage.deviation_ns[n] = n % 2 == 0 ? 18'000 : -18'000;
  EXPECT_THAT(marked(run(stage, 500e-6, nullptr, 20e-6)), testing::ElementsAre(100, 110));
}

TEST(MeasurementLoopInstants, SamplesOffByMoreThanTheLimitAreMarkedWhateverTheRun) {
  StampedStage stage;
  stage.deviation_ns = {{50, 60'000}};
  EXPECT_THAT(marked(run(stage, 50e-6, nullptr, 20e-6)), testing::ElementsAre(50));
}

TEST(MeasurementLoopInstants, ATickThatTheStageSkippedIsMarked) {
  StampedStage stage(true);
  for (std::uint64_t n = 100; n <= kSamples + 1; ++n) stage.deviation_ns[n] = kPeriod_ns;
  // Then the clock is followed from its new reading.
  EXPECT_THAT(marked(run(stage, kJitter_s)), testing::ElementsAre(100, 101, 102));
}

TEST(MeasurementLoopInstants, ManyIrregularSamplesDoNotEndTheRun) {
  StampedStage stage;
  for (std::uint64_t n = 10; n < kSamples; n += 2) stage.deviation_ns[n] = 100'000;
  EXPECT_EQ(marked(run(stage, kJitter_s)).size(), (kSamples - 10) / 2);
}

TEST(MeasurementLoopInstants, ArrivalAndTimeOfTheNodeAreInTheRows) {
  StampedStage stage;
  stage.deviation_ns = {{50, 5'000}};
  const std::vector<Row> rows = run(stage, kJitter_s);
  EXPECT_EQ(rows[0].stamp, SampleStamp{}) << "the run begins without a setpoint";
  EXPECT_EQ(rows[7].stamp.arrival_ns, kDelay_ns);
  EXPECT_EQ(rows[50].stamp.arrival_ns, kDelay_ns + 5'000);
  EXPECT_EQ(rows[50].stamp.node_us,
            static_cast<std::uint16_t>((kNode_ns + 50 * kPeriod_ns + 5'000) / 1000));
}

}  // namespace stageid::test_measurement_loop_instants
