// The group `realtime` of a stage file, through the program.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/tools/program_fixture.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid::test {
namespace test_real_time_keys {

struct RealTimeKeysTest : ProgramTest {
  /// An experiment whose stage file ends with these lines.
  std::string with(const std::string& lines) const {
    return stage("rt.yaml", "noise:", lines + "\nnoise:");
  }
};

TEST_F(RealTimeKeysTest, AreReadAsTheyStand) {
  with("realtime: {policy: try, priority: 42, cpu: 0, lock_memory: false, misses_allowed: 3}");
  const StageConfig config = load_stage_config(at("stage_rt.yaml"));
  EXPECT_EQ(config.real_time.options.policy, RealTimePolicy::attempt);
  EXPECT_EQ(config.real_time.options.priority, 42);
  EXPECT_EQ(config.real_time.options.cpu, 0);
  EXPECT_FALSE(config.real_time.options.lock_memory);
  EXPECT_EQ(config.real_time.misses_allowed, 3);
}

TEST_F(RealTimeKeysTest, AreOffUnlessAskedFor) {
  const StageConfig config = load_stage_config(at("small_stage.yaml"));
  EXPECT_EQ(config.real_time.options.policy, RealTimePolicy::off);
  EXPECT_EQ(config.real_time.misses_allowed, 10);
}

TEST_F(RealTimeKeysTest, WhatIsWrongIsNamed) {
  fail("run " + with("realtime: {policy: hard}") + " -o x.slog", 2, "policy");
  fail("run " + with("realtime: {priority: 100}") + " -o x.slog", 2, "priority");
}

TEST_F(RealTimeKeysTest, HaveNoMeaningInVirtualTime) {
  succeed("run " + with("realtime: {policy: require}") + " -o x.slog");
}

TEST_F(RealTimeKeysTest, RequireIsRefusedBeforeAnythingIsWrittenUnlessAllIsThere) {
  const std::string config = with("realtime: {policy: require, lock_memory: false}");
  try {
    missing_for_real_time({RealTimePolicy::require, 80, -1, false});
  } catch (const std::exception&) {
    fail("run " + config + " -o x.slog --pace 4", 1, "policy: try");
    return;
  }
  GTEST_SKIP() << "this machine has all that is required";
}

TEST_F(RealTimeKeysTest, AWallClockRunTellsItsTimingEverywhere) {
  run("run " + with("realtime: {policy: try, misses_allowed: 1000000}") + " -o run.slog --pace 4");
  const auto info = tell("log info run.slog");
  ASSERT_EQ(info["runs"].size(), 9U);
  for (const auto& run : info["runs"]) {
    std::uint64_t counted = 0;
    for (const auto& bin : run["timing"]["lateness"]["bins"])
      counted += bin[2].get<std::uint64_t>();
    EXPECT_EQ(counted, run["samples"].get<std::uint64_t>());
    EXPECT_GT(run["timing"]["execution"]["median_s"].get<double>(), 0.0);
  }
  EXPECT_THAT(succeed("log info run.slog").out, testing::HasSubstr("execution"));
  succeed("report run.slog -o report.html");
  EXPECT_THAT(read_bytes(at("report.html")), testing::HasSubstr(R"("period_s":0.000125)"));
}

TEST_F(RealTimeKeysTest, EventsStandBesideTheLogAlsoOfAResumedOne) {
  make_log();
  EXPECT_THAT(read_bytes(at("run.events.jsonl")), testing::HasSubstr(R"("event":"start")"));
  EXPECT_THAT(read_bytes(at("run.events.jsonl")),
              testing::HasSubstr(R"("event":"end","exit_code":0)"));
  succeed("run " + config_ + " -o run.slog --resume");
  EXPECT_THAT(read_bytes(at("run.events.jsonl")), testing::HasSubstr(R"("event":"resume")"));
}

}  // namespace test_real_time_keys
}  // namespace stageid::test
