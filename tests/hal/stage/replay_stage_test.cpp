#include "hal/stage/replay_stage.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/hal/stage/fake_stage.hpp"
#include "tests/hal/stage_bench.hpp"

namespace stageid::test_replay_stage {

struct Recorded {
  Eigen::MatrixXd u, y;
  Eigen::VectorXi marked;
};

class MemorySource final : public ReplaySource {
 public:
  explicit MemorySource(std::vector<Recorded> runs) : runs_(std::move(runs)) {}
  int runs() const override { return static_cast<int>(runs_.size()); }
  void load(int run, Eigen::MatrixXd& u, Eigen::MatrixXd& y, Eigen::VectorXi& marked) override {
    const Recorded& r = runs_[run];
    u = r.u;
    y = r.y;
    marked = r.marked;
  }

 private:
  std::vector<Recorded> runs_;
};

Recorded recorded(double offset) {
  Recorded run;
  run.u = Eigen::MatrixXd(2, 4);
  run.u << 1, 2, 3, 4, 5, 6, 7, 8;
  run.y = Eigen::MatrixXd(1, 4);
  run.y << 10, 20, 30, 40;
  run.u.array() += offset;
  run.y.array() += offset;
  run.marked = Eigen::VectorXi::Zero(4);
  return run;
}

StageInfo info() { return test::FakeStage(2, 1, 1e3).info(); }

ReplayStage stage(std::vector<Recorded> runs, double tolerance_n = 1e-9) {
  return {info(), std::make_unique<MemorySource>(std::move(runs)), tolerance_n};
}

/// Replays, starting with the first run.
struct Host : test::Driver {
  explicit Host(ReplayStage& stage) : Driver(stage) { start(); }
  Outcome give(double u0, double u1) {
    u = {u0, u1};
    return step();
  }
};

TEST(ReplayTest, GivesTheRecordSampleBySample) {
  ReplayStage replay = stage({recorded(0.0), recorded(100.0)});
  Host host(replay);
  for (const double offset : {0.0, 100.0}) {
    if (offset > 0.0) host.start();
    EXPECT_EQ(host.inputs.cycle, 0U);
    for (int n = 0; n < 4; ++n) {
      EXPECT_EQ(host.y[0], 10.0 * (n + 1) + offset);
      EXPECT_EQ(host.inputs.valid, 1U);
      EXPECT_EQ(host.give(n + 1.0 + offset, n + 5.0 + offset), Outcome::ok);
      EXPECT_EQ(host.inputs.cycle, static_cast<std::uint64_t>(n + 1));
      EXPECT_EQ(host.inputs.t_sample_ns, 1'000'000 * (n + 1));
    }
    EXPECT_EQ(host.y[0], 40.0 + offset) << "held after the last sample";
    EXPECT_EQ(host.give(0.0, 0.0), Outcome::link_down);
    EXPECT_EQ(host.inputs.valid, 0U);
    replay.stop();
  }
  EXPECT_EQ(replay.mismatches(), 0U);
  EXPECT_EQ(replay.largest_mismatch_n(), 0.0);
}

TEST(ReplayTest, CountsCommandsThatDiffer) {
  ReplayStage replay = stage({recorded(0.0)}, 0.01);
  Host host(replay);
  EXPECT_EQ(host.give(1.0, 5.005), Outcome::ok);
  EXPECT_EQ(replay.mismatches(), 0U);
  EXPECT_EQ(host.give(2.5, 6.0), Outcome::ok);
  EXPECT_EQ(replay.mismatches(), 1U);
  EXPECT_DOUBLE_EQ(replay.largest_mismatch_n(), 0.5);
  EXPECT_EQ(host.give(std::numeric_limits<double>::quiet_NaN(), 0.0), Outcome::ok);
  EXPECT_EQ(replay.mismatches(), 3U);
  EXPECT_DOUBLE_EQ(replay.largest_mismatch_n(), 7.0);
}

TEST(ReplayTest, PassesTheMarksOn) {
  Recorded run = recorded(0.0);
  run.marked << 1, 0, 2, 0;
  ReplayStage replay = stage({run});
  Host host(replay);
  EXPECT_EQ(host.inputs.valid, 0U);
  EXPECT_EQ(host.give(1, 5), Outcome::ok);
  EXPECT_EQ(host.give(2, 6), Outcome::late);
  EXPECT_EQ(host.give(3, 7), Outcome::ok);
}

TEST(ReplayTest, StopsForGood) {
  ReplayStage replay = stage({recorded(0.0)});
  Host host(replay);
  replay.stop();
  replay.stop();
  EXPECT_EQ(host.give(1, 5), Outcome::link_down);
}

TEST(ReplayTest, RefusesARunThatIsNotThereOrDoesNotFit) {
  ReplayStage one = stage({recorded(0.0)});
  Host host(one);
  EXPECT_THROW(host.start(), StageError);
  const auto refuse = [&](void (*change)(Recorded&)) {
    Recorded run = recorded(0.0);
    change(run);
    ReplayStage replay = stage({run});
    EXPECT_THROW(Host{replay}, StageError);
  };
  refuse([](Recorded& r) { r.u.conservativeResize(1, 4); });
  refuse([](Recorded& r) { r.y.conservativeResize(2, 4); });
  refuse([](Recorded& r) { r.y.conservativeResize(1, 3); });
  refuse([](Recorded& r) { r.marked.resize(3); });
  refuse([](Recorded& r) {
    r.u.resize(2, 0);
    r.y.resize(1, 0);
    r.marked.resize(0);
  });
}

TEST(ReplayTest, RefusesBadArguments) {
  EXPECT_THROW(ReplayStage(info(), nullptr, 0.0), std::invalid_argument);
  EXPECT_THROW(stage({}, -1.0), std::invalid_argument);
  EXPECT_THROW(stage({}, std::numeric_limits<double>::quiet_NaN()), std::invalid_argument);
  StageInfo blind = info();
  blind.sensors.clear();
  EXPECT_THROW(ReplayStage(blind, std::make_unique<MemorySource>(std::vector<Recorded>{}), 0.0),
               std::invalid_argument);
  StageInfo timeless = info();
  timeless.sample_rate_hz = 0.0;
  EXPECT_THROW(ReplayStage(timeless, std::make_unique<MemorySource>(std::vector<Recorded>{}), 0.0),
               std::invalid_argument);
  ReplayStage replay = stage({recorded(0.0)});
  std::vector<double> wrong(2);
  Inputs inputs;
  inputs.y = wrong;
  EXPECT_THROW(replay.start(0, inputs), std::invalid_argument);
}

}  // namespace stageid::test_replay_stage
