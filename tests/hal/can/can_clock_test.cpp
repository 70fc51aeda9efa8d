// A node that samples by its own clock, and the host that follows it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <vector>

#include "tests/hal/can/can_host.hpp"
#include "tests/hal/stage_bench.hpp"

namespace stageid::test_can_clock {

using test::CanRig;

constexpr double kPeriod_ns = 1e6;
constexpr double kDrift = 100e-6;
constexpr double kOffset_ns = 3e12;

/// The end of a node whose clock has another offset and is fast.
struct DriftingEnd final : CanThrough {
  using CanThrough::CanThrough;
  std::int64_t now_ns() const noexcept override {
    return std::llround(kOffset_ns + (1.0 + kDrift) * static_cast<double>(CanThrough::now_ns()));
  }
};

/// The node works at its ticks only, one per period of its clock.
class TickingNode {
 public:
  explicit TickingNode(std::int64_t tick_ns = 1'000'000)
      : end_(pair_.node()),
        node_(rig_.new_node(0.1)),
        front_(node_, rig_.layout(), end_),
        tick_ns_(tick_ns) {
    pair_.when_host_waits([this] { serve(); }, 1'000);
  }

  test::CanPair& pair() { return pair_; }
  std::unique_ptr<CanStage> host(bool node_clock) {
    CanSpec spec = rig_.spec();
    spec.node_clock = node_clock;
    // The transport of the pair lives longer than the host.
    return std::make_unique<CanStage>(rig_.stage_spec().info, spec,
                                      std::make_unique<CanThrough>(pair_.host()),
                                      CanHostOptions{.pace = 1.0});
  }
  int skip_at = -1;  ///< tick that does nothing

 private:
  void serve() {
    if (node_.state() != NodeState::measuring) {
      front_.serve(0);
      next_ns_ = 0;
      return;
    }
    const std::int64_t now_ns = end_.now_ns();
    if (next_ns_ == 0) next_ns_ = now_ns + tick_ns_;
    if (now_ns < next_ns_) return;
    next_ns_ += tick_ns_;
    if (ticks_++ != skip_at) front_.serve(0);
  }

  CanRig rig_;
  test::CanPair pair_{{"pair0"}};
  DriftingEnd end_;
  StageNode node_;
  CanNode front_;
  std::int64_t tick_ns_;
  std::int64_t next_ns_ = 0;
  int ticks_ = 0;
};

/// Exchanges zeros and records the instants.
struct Samples {
  std::vector<std::int64_t> instant_ns, stamp_ns, arrival_ns;
  std::vector<Outcome> outcomes;
};

Samples measure(CanStage& stage, int count,
                std::int64_t deadline_ns = 2 * std::llround(kPeriod_ns)) {
  Samples samples;
  test::Driver host(stage);
  Inputs& inputs = host.inputs;
  host.start();
  for (int n = 0; n < count; ++n) {
    inputs.stamp_ns = inputs.t_arrival_ns = 0;
    samples.outcomes.push_back(host.step({inputs.t_sample_ns + deadline_ns}));
    samples.instant_ns.push_back(inputs.t_sample_ns);
    samples.stamp_ns.push_back(inputs.stamp_ns);
    samples.arrival_ns.push_back(inputs.t_arrival_ns);
  }
  return samples;
}

TEST(CanClock, TheHostFollowsTheTicksOfTheNode) {
  TickingNode node;
  const std::unique_ptr<CanStage> host = node.host(true);
  EXPECT_TRUE(host->info().sets_pace);
  EXPECT_TRUE(host->info().stamps);
  const Samples samples = measure(*host, 2000);
  EXPECT_THAT(samples.outcomes, testing::Each(Outcome::ok));
  for (std::size_t n = 1; n < samples.stamp_ns.size(); ++n)
    ASSERT_NEAR(static_cast<double>(samples.stamp_ns[n] - samples.stamp_ns[n - 1]), kPeriod_ns, 2e3)
        << "one period of the node, with its resolution of 1 us, " << n;
  // On the host's clock a period is shorter, by the drift. The steps of the simulated time are 1 us.
  const double first = static_cast<double>(samples.instant_ns[1000]);
  const double period_ns = (static_cast<double>(samples.instant_ns[1999]) - first) / 999.0;
  EXPECT_NEAR(period_ns, kPeriod_ns / (1.0 + kDrift), 5.0);
  for (std::size_t n = 1000; n < 2000; ++n)
    ASSERT_NEAR(static_cast<double>(samples.instant_ns[n] - samples.arrival_ns[n]), 0.0, 2e3) << n;
}

TEST(CanClock, TheNodesTimeGoesOnOverItsSixteenBits) {
  TickingNode node(40'000'000);  // 40 ms of 65.536 ms
  const Samples samples = measure(*node.host(true), 20, 100'000'000);
  EXPECT_THAT(samples.outcomes, testing::Each(Outcome::ok));
  for (std::size_t n = 1; n < 20; ++n)
    EXPECT_NEAR(static_cast<double>(samples.stamp_ns[n] - samples.stamp_ns[n - 1]), 40e6, 2e3) << n;
}

TEST(CanClock, ASkippedTickShowsInTheStamps) {
  TickingNode node;
  node.skip_at = 1500;
  const std::unique_ptr<CanStage> host = node.host(true);
  const Samples samples = measure(*host, 2000);
  int long_steps = 0;
  for (std::size_t n = 1; n < samples.stamp_ns.size(); ++n)
    long_steps += std::abs(samples.stamp_ns[n] - samples.stamp_ns[n - 1] - 2'000'000) < 2'000;
  EXPECT_EQ(long_steps, 1);
}

TEST(CanClock, ASimulatedNodeCanWaitForItsTicks) {
  CanRig rig;
  CanNode front(rig.node(), rig.layout(), rig.pair().node(), 0.0, true);
  rig.pair().when_host_waits([&] { front.serve(0); });
  test::RunningCanHost host(rig);
  const std::int64_t began_ns = monotonic_ns();
  EXPECT_EQ(host.exchange(10), test::all_ok(10));
  // The first tick may be near; a busy machine may be slower, never faster.
  EXPECT_GE(monotonic_ns() - began_ns, 9 * std::llround(kPeriod_ns));
}

TEST(CanClock, ANodeWithAClockNeedsTheWallClock) {
  CanRig rig;
  CanSpec spec = rig.spec();
  spec.node_clock = true;
  EXPECT_THROW(CanStage(rig.stage_spec().info, spec, rig.host_bus(), {.pace = 0.0}),
               std::invalid_argument);
}

}  // namespace stageid::test_can_clock
