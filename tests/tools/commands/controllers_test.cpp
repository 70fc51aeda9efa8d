// Controllers in every form, feed-forward and the held loop, with the real program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include <nlohmann/json.hpp>

#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "tests/tools/config/controller_arrays.hpp"
#include "tests/tools/program_fixture.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid::test {
namespace test_controllers {

using nlohmann::json;
using testing::HasSubstr;

struct Controllers : ProgramTest {
  /// The small experiment with another text from `controller:` on in its stage file.
  std::string with_controller(const std::string& file, const std::string& controller) const {
    const std::string stage = read_bytes(at("small_stage.yaml"));
    write_bytes(at("stage_" + file), stage.substr(0, stage.find("controller:")) + controller);
    return experiment(file, "stage: small_stage.yaml", "stage: stage_" + file);
  }
  /// Its controller as matrices, times a factor.
  std::string in_matrices(const std::string& file, double factor) const {
    const MotionController controller(load_stage_config(at("small_stage.yaml")).spec.controller);
    ControllerStateSpace s = controller.realization();
    s.c *= factor;
    s.d *= factor;
    write_npz(at("c.npz"), arrays_of(at("c.npz"), s));
    return with_controller(file, "controller: c.npz\n");
  }
  json findings(const std::string& log) const {
    const json told = json::parse(run("frf " + log + " -o " + log + ".h5 --json").out);
    return told["health"];
  }
};

TEST_F(Controllers, MatricesMeasureAndAreCheckedAsAxesAre) {
  const std::string config = in_matrices("matrices.yaml", 1.0);
  EXPECT_EQ(succeed("config check " + config).err, "");
  const std::string axes = succeed("design " + config_ + " -o axes.h5").out;
  const std::string matrices = succeed("design " + config + " -o matrices.h5").out;
  EXPECT_EQ(axes.substr(0, axes.find("wrote")), matrices.substr(0, matrices.find("wrote")));
  succeed("run " + config + " -o m.slog");
  std::filesystem::remove(at("c.npz"));  // the log knows its controller
  for (const json& finding : findings("m.slog")) {
    EXPECT_NE(finding["severity"], "fault") << finding;
    EXPECT_NE(finding["severity"], "doubt") << finding;
    EXPECT_NE(finding["cause"], "unknown_stage") << finding;
  }
}

TEST_F(Controllers, AWrongSignIsRefusedBeforeAnythingMoves) {
  const std::string config = in_matrices("wrong.yaml", -1.0);
  for (const std::string command : {"run ", "design ", "identify "})
    ends(command + config + " -o wrong.slog", 2, "the controller does not stabilize the plant");
  EXPECT_THAT(run("config check " + config).err, HasSubstr("does not stabilize"));
}

TEST_F(Controllers, APeerIsNotComputedHere) {
  const std::string config = with_controller("peer.yaml", "controller: peer\n");
  ends("config check " + config, 0,
       "the stage closes it by a controller of its own ('controller: peer')");
  ends("design " + config + " -o peer.h5", 0, "signals are not predicted");
  ends("run " + config + " -o peer.slog", 2, "'backend: can' with 'mode: resident'");
  EXPECT_THAT(run("node stage_peer.yaml --modbus-tcp 0").err,
              HasSubstr("its controller is 'peer'"));
}

TEST_F(Controllers, AFeedForwardIsInTheCommandsAndCountsInTheLimits) {
  const std::string config = stage("bias.yaml", "limit_n: 40", "limit_n: 40, bias_n: 6");
  succeed("run " + config + " -o bias.slog");
  LogSamples samples;
  const std::unique_ptr<LogReader> log = open_log(at("bias.slog"));
  log->read(0, 0, 1, samples);
  // It pushed the simulated stage, which has no weight, aside; the noise is 1e-9 m.
  EXPECT_GT(std::abs(samples.sensors(0, 0)), 1e-6);
  const std::string strong = stage("strong.yaml", "limit_n: 40", "limit_n: 40, bias_n: 38");
  ends("design " + strong + " -o strong.h5", 2, "a1: |u| would be");
}

TEST_F(Controllers, AHeldStageIsMeasuredAndResumed) {
  const std::string config = stage("held.yaml", "\nstuck", "\nbetween_runs: hold\nstuck");
  succeed("run " + config + " -o held.slog");
  for (const json& finding : findings("held.slog")) {
    EXPECT_NE(finding["severity"], "fault") << finding;
    EXPECT_NE(finding["severity"], "doubt") << finding;
  }
  EXPECT_THAT(succeed("run " + config + " -o held.slog --resume").out,
              HasSubstr("9 of 9 runs complete"));
  EXPECT_THAT(read_bytes(at("held.events.jsonl")), HasSubstr("\"event\":\"hold\""));
  // A recorded run ends with the run.
  succeed("run " + config +
          " -o again.slog --backend replay --replay held.slog --replay-tolerance 100");
}

}  // namespace test_controllers
}  // namespace stageid::test
