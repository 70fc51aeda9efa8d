// A permanent excitation from a model: the file that design writes is an experiment, and plays what was designed.
#include "tools/experiment/watch_plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frf/file/frf_file.hpp"
#include "tests/tools/program_fixture.hpp"
#include "tools/experiment/config_plan.hpp"

namespace stageid::test {
namespace test_watch_plan {

using Json = nlohmann::json;

struct WatchPlanTest : ProgramTest {
  WatchPlanTest() { make_model(); }
  Json design(const std::string& more = "") const {
    return tell("design " + config_ + " --watch model.json --frf frf.h5 -o w.yaml " + more);
  }
  /// The same, refused.
  void refuse(const std::string& more, const std::string& text, const std::string& config) const {
    fail("design " + config + " --watch model.json --frf frf.h5 -o w.yaml " + more, 2, text);
  }
};

TEST_F(WatchPlanTest, TheFileIsAnExperimentThatPlaysTheDesign) {
  const Json told = design();
  const ExperimentConfig config = load_experiment_config(at("w.yaml"));
  const ExperimentPlan plan = make_plan(config);
  EXPECT_EQ(plan.grid().lines(), told["lines"].get<std::vector<int>>());
  EXPECT_EQ(plan.experiments(), 1);
  // What is predicted for the file agrees with what was designed.
  const WatchForecast forecast =
      forecast_of(config, read_model(at("model.json")), read_frf(at("frf.h5")), 1e-5);
  for (std::size_t p = 0; p < told["tracked"].size(); ++p)
    EXPECT_NEAR(forecast.deviation[p], told["tracked"][p]["deviation"],
                1e-3 * told["tracked"][p]["deviation"].get<double>());

  succeed("design w.yaml -o w.h5");
  const ExperimentPlan read = read_plan_of(config, at("w.h5"));
  EXPECT_EQ(read.excitation({0, 0}), plan.excitation({0, 0}));
  succeed("run w.yaml --excitation w.h5 -o w.slog");
  fail("frf w.slog -o no.h5", 2, "only 1 experiment");
}

TEST_F(WatchPlanTest, KnowsTheFrequenciesBetterThanTheFlatMultisine) {
  const Json told = design();
  const WatchForecast flat = forecast_of(
      load_experiment_config(config_), read_model(at("model.json")), read_frf(at("frf.h5")), 1e-5);
  EXPECT_LT(told["tracked"][0]["deviation"].get<double>(), 0.7 * flat.deviation[0]);
}

TEST_F(WatchPlanTest, KeepsTheSensorsWithinARms) {
  design("--rms-nm 5");
  const Json predicted = tell("design w.yaml -o w.h5");
  double most = 0.0;
  for (const Json& sensor : predicted["sensors"])
    most = std::max(most, sensor["rms"].get<double>());
  EXPECT_NEAR(most, 5e-9, 0.1e-9);
}

TEST_F(WatchPlanTest, NeedsNoiseInTheBandAndLevels) {
  fail("design " + config_ + " --watch model.json -o w.yaml", 2, "--frf");
  fail("design " + config_ + " --watch model.json --frf frf.h5 -o w.h5", 2, ".yaml");
  refuse("--drift 1e300", "expected", config_);
  refuse("--rms-nm 1e-300", "expected", config_);
  refuse("--rms-nm inf", "expected", config_);
  refuse("--accuracy 1e-6", "--accuracy", config_);
  refuse("", "rms_n", experiment("peak.yaml", "rms_n: 1.0", "peak_n: 1.0"));
  refuse("", "narrow band_hz", experiment("wide.yaml", "[16, 800]", "[16, 950]"));
}

TEST_F(WatchPlanTest, TheFileNamesAStageInAFolderWithAnyName) {
  const std::filesystem::path folder = at("of a: 'b' #1 [x]");
  std::filesystem::create_directory(folder);
  ExperimentConfig config = load_experiment_config(config_);
  const WatchPlan plan = make_watch_plan(config, {at("model.json"), at("frf.h5")});
  std::filesystem::copy_file(config.stage.file, folder / "stage.yaml");
  config.stage.file = folder / "stage.yaml";
  write_bytes(at("w.yaml"), watch_experiment_text(plan, config, at("w.yaml")));
  EXPECT_NO_THROW(load_experiment_config(at("w.yaml")));
}

TEST_F(WatchPlanTest, ListedLinesAndPhasesAreChecked) {
  const auto refuses = [&](const std::string& lines, const std::string& text) {
    fail("design " + experiment("x.yaml", "lines: all", lines) + " -o x.h5", 2, text);
  };
  refuses("lines: [8, 7]", "increasing whole numbers");
  refuses("lines: [8.5]", "increasing whole numbers");
  refuses("lines: [2, 8]", "outside band_hz");
  refuses("lines: [8, 9]\n  phases: [{axis: zz, rad: [0, 1]}]", "'zz' is not an axis");
  refuses("lines: [8, 9]\n  phases: [{axis: a1, rad: [0]}]", "expected one finite number per line");
}

}  // namespace test_watch_plan
}  // namespace stageid::test
