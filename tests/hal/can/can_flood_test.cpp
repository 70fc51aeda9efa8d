// Deadlines are checked even if a bus is never silent.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <utility>

#include "tests/hal/can/altered_can.hpp"
#include "tests/hal/can/can_host.hpp"
#include "tests/hal/stage_bench.hpp"

namespace stageid::test_can_flood {

using test::CanRig;
using Host = test::CanHost;

/// A bus that is never silent: each receive() takes some time and returns a full batch.
test::AlteredCan::Alter flood(CanRig& rig) {
  return [&rig](std::span<CanFrame> frames, std::size_t count) {
    rig.pair().pass_time(100'000);
    for (; count < frames.size(); ++count) frames[count].id = 0x7FF;
    return count;
  };
}

TEST(CanFlood, AFrozenNodeIsNoticedInTime) {
  CanRig rig;
  bool flooded = false;
  const auto bus = rig.host_bus();
  const auto alter = flood(rig);
  auto transport =
      std::make_unique<test::AlteredCan>(*bus, [&](std::span<CanFrame> frames, std::size_t count) {
        return flooded ? alter(frames, count) : count;
      });
  CanStage stage(rig.stage_spec().info, rig.spec(), std::move(transport), {});
  test::Driver host(stage);
  host.start();
  rig.freeze();
  flooded = true;
  const std::int64_t before_ns = rig.pair().now_ns();
  EXPECT_EQ(host.step(), Outcome::stale);
  EXPECT_LE(rig.pair().now_ns() - before_ns, 4 * 5'100'000) << "four times reply_timeout_s";
  stage.stop();  // must return too
}

TEST(CanFlood, AnInterruptEndsTheWaitForAnAnswer) {
  CanRig rig;
  rig.freeze();
  int looks = 0;
  CanHostOptions options;
  options.interrupted = [&] { return ++looks > 3; };
  const auto bus = rig.host_bus();
  CanStage stage(rig.stage_spec().info, rig.spec(),
                 std::make_unique<test::AlteredCan>(*bus, flood(rig)), options);
  const std::int64_t before_ns = rig.pair().now_ns();
  EXPECT_THAT([&] { stage.connect(); },
              testing::ThrowsMessage<StageError>(testing::HasSubstr("interrupted")));
  EXPECT_LT(rig.pair().now_ns() - before_ns, 60'000'000) << "before the first attempt was over";
}

TEST(CanFlood, TheNodesWatchdogLooksAtTheTimeAllTheSame) {
  CanRig rig;
  Host host(rig);
  StageNode stage = rig.new_node();
  bool flooded = false;
  const auto alter = flood(rig);
  test::AlteredCan bus(rig.pair().node(), [&](std::span<CanFrame> frames, std::size_t count) {
    return flooded ? alter(frames, count) : count;
  });
  CanNode front(stage, rig.layout(), bus);
  rig.pair().when_host_waits([&] { front.serve(0); });
  host.start();
  flooded = true;
  for (int turn = 0; turn < 300; ++turn) front.serve(0);
  EXPECT_EQ(stage.cause(), FaultCause::watchdog);
}

}  // namespace stageid::test_can_flood
