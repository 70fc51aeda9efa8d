// The commands in their order, on the real program with the small stage.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include <cmath>
#include <nlohmann/json.hpp>
#include <tuple>

#include "acquisition/formats/open_log.hpp"
#include "acquisition/prediction/closed_loop_prediction.hpp"
#include "acquisition/record/log_reader.hpp"
#include "estimation/model/additive_model.hpp"
#include "frf/file/frf_file.hpp"
#include "tests/tools/program_fixture.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid::test {
namespace test_workflow {

using nlohmann::json;
using testing::HasSubstr;

struct Workflow : ProgramTest {
  /// Writes FILE.yaml, a stage with this fault, and runs it into FILE.slog. @returns the information about that log
  json run_with_fault(const std::string& file, const std::string& fault, int exit_code,
                      const std::string& cause, const std::string& more = "",
                      const std::string& keys = "") const {
    const std::string config =
        stage(file + ".yaml", "noise:", keys + "faults: [{" + fault + "}]\nnoise:");
    EXPECT_THAT(ends("run " + config + " -o " + file + ".slog", exit_code, cause).err,
                HasSubstr(more));
    return tell("log info " + file + ".slog");
  }
};

/// summary.json of `identify`
json summary_of(const std::filesystem::path& directory) {
  return json::parse(read_bytes(directory / "summary.json"));
}

/// All modes of the plant and no others. 3 standard deviations is the issue's bound; 4.5 leaves a chance of 1e-4 to a
/// right program that draws other noise. The relative bound holds where bias is all there is.
void expect_true_modes(const json& summary, double relative_bound = 0.0) {
  EXPECT_EQ(summary["truth"]["extra_modes_hz"].size(), 0U);
  for (const json& mode : summary["truth"]["modes"]) {
    ASSERT_TRUE(mode["found"]) << mode;
    const double error =
        mode["natural_frequency_hz"].get<double>() / mode["true_frequency_hz"].get<double>() - 1.0;
    EXPECT_TRUE(std::abs(mode["frequency_deviation_in_std"].get<double>()) < 4.5 ||
                std::abs(error) < relative_bound)
        << mode;
  }
}

constexpr std::array kOutputs = {"excitation.h5", "run.slog",   "frf.h5",   "frf_validation.h5",
                                 "modes.json",    "model.json", "model.h5", "model.csv",
                                 "summary.json",  "report.html"};

TEST_F(Workflow, IdentifyFindsEveryModeOfTheStage) {
  const ProgramResult result = succeed("identify " + config_ + " -o all");
  for (const char* output : kOutputs)
    EXPECT_TRUE(std::filesystem::exists(at("all") / output)) << output;
  EXPECT_THAT(result.out, HasSubstr("report: all/report.html"));
  const json summary = summary_of(at("all"));
  EXPECT_TRUE(summary["trustworthy"]);
  ASSERT_GE(summary["truth"]["modes"].size(), 3U);
  expect_true_modes(summary, 1e-4);
  for (const json& mode : summary["truth"]["modes"])
    EXPECT_GT(mode["natural_frequency_std_hz"].get<double>(), 0.0);
  EXPECT_LT(summary["truth"]["relative_rms_error"].get<double>(), 0.05);
  EXPECT_NEAR(summary["validation"]["chi_square_per_dof"].get<double>(), 1.0, 0.3);
}

// Realizations show a cubic stiffness, periods do not: the fit weighs by the realizations.
TEST_F(Workflow, ANonlinearPlantIsNamedAndItsModesAreFound) {
  const std::string config =
      stage("cubic.yaml", "  plate:", "  cubic_stiffness_n_m3: 1e15\n  plate:");
  ends("identify " + config + " -o cubic", 0, "weighting: total_variance; the plant is nonlinear");
  const json summary = summary_of(at("cubic"));
  EXPECT_EQ(summary["fit"]["weighting"], "total_variance");
  expect_true_modes(summary);
}

// A tenth of the excitation per step: the idle actuators move by less.
TEST_F(Workflow, TheStepsOfACoarseConverterAreFoundAndTheModelIsThatOfThePlant) {
  const std::string config =
      stage("coarse.yaml", "force_n: 1e-4,", "force_n: 1e-4, actuator_quantum_n: 0.1,");
  succeed("identify " + config + " -o result");
  const json summary = summary_of(at("result"));
  std::string steps;
  for (const json& finding : summary["health"])
    if (finding["cause"] == "actuator_step")
      steps += finding["channel"].get<std::string>() + ": " + finding["figure"].get<std::string>();
  EXPECT_EQ(steps, "a1 a2 a3: 0.1 N, rounded to the nearest");
  EXPECT_LT(summary["truth"]["relative_rms_error"].get<double>(), 0.02);
  expect_true_modes(summary);
}

TEST_F(Workflow, TheSameFilesAgainAndWithOtherThreads) {
  succeed("identify " + config_ + " -o one --threads 1");
  succeed("identify " + config_ + " -o two --threads 2");
  for (const char* file : {"excitation.h5", "frf.h5", "frf_validation.h5", "modes.json",
                           "model.json", "model.h5", "model.csv"})
    EXPECT_TRUE(same_bytes(read_bytes(at("one") / file), read_bytes(at("two") / file))) << file;
}

TEST_F(Workflow, ResumePassesOverWhatIsUpToDate) {
  succeed("identify " + config_ + " -o all");
  const auto before = snapshot(at("all"));
  ends("identify " + config_ + " -o all", 2);
  const ProgramResult again = succeed("identify " + config_ + " -o all --resume");
  for (const char* step : {"design", "run", "frf", "fit"})
    EXPECT_THAT(again.err, testing::ContainsRegex(std::string(step) + " .*up to date"));
  const auto after = snapshot(at("all"));
  for (const char* file : {"run.slog", "frf.h5", "model.json", "model.h5"})
    EXPECT_TRUE(same_bytes(before.at(name("all/") + file), after.at(name("all/") + file))) << file;
  // Another fit: the measurement stays, the model does not.
  write_bytes(config_, replaced(read_bytes(config_), "direct_term: full", "direct_term: none"));
  const ProgramResult refit = run("identify " + config_ + " -o all --resume");
  EXPECT_THAT(refit.err, testing::ContainsRegex("run .*up to date"));
  EXPECT_THAT(refit.err, testing::Not(testing::ContainsRegex("fit .*up to date")));
  EXPECT_FALSE(same_bytes(before.at(name("all/model.json")), read_bytes(at("all/model.json"))));
}

TEST_F(Workflow, AFaultThatOpensTheLoopEndsWithCodeFourAndItsCause) {
  const std::pair<const char*, const char*> cases[] = {
      {"kind: actuator_gain, value: -1", "deviation from the predicted motion"},
      {"kind: sensor_offset, channel: s1, value: 6e-4", "sensor s1: jumped"},
      {"kind: nan_sensor, channel: s2", "sensor s2: the measurement is not finite"}};
  int number = 0;
  for (const auto& [fault, cause] : cases) {
    const std::string file = "open" + std::to_string(++number);
    const json info =
        run_with_fault(file, std::string(fault) + ", from_cycle: 1700", 4, cause, "; braked, ");
    EXPECT_GT(info["runs"][0]["health"]["marked"], 0);
    // The applied forces, not the commands of the controller.
    const std::unique_ptr<LogReader> log = open_log(at(file + ".slog"));
    LogSamples all;
    log->read(0, 0, log->runs()[0].samples, all);
    EXPECT_LE(all.actuators.cwiseAbs().maxCoeff(), 40.0);
  }
}

TEST_F(Workflow, AFaultWhileAGoodRunIsRampedDownIsToldAndTheRunIsKept) {
  const std::tuple<const char*, int, const char*> cases[] = {
      {"kind: sensor_offset, channel: s1, value: 6e-4", 4, "sensor s1: jumped"},
      {"kind: interlock", 1, "reports: fault"}};
  for (const auto& [fault, exit_code, cause] : cases) {
    const std::string file = "landing" + std::to_string(exit_code);
    const json info =
        run_with_fault(file, std::string(fault) + ", from_cycle: 2505", exit_code, cause);
    ASSERT_EQ(info["runs"].size(), 1U);
    EXPECT_TRUE(info["runs"][0]["complete"]);
    EXPECT_EQ(info["runs"][0]["samples"], 2500);
    EXPECT_EQ(info["runs"][0]["health"]["marked"], 0);
  }
}

TEST_F(Workflow, TheRampOfAStopIsAsLongAsTheStageFileSays) {
  // Less than half a window: the loop follows it, past a limit of force, and is sound.
  const json info = run_with_fault("ramp", "kind: sensor_offset, from_cycle: 1700, value: 4.9e-4",
                                   4, "|u|", "", "ramp_s: 0.01\n");
  EXPECT_NEAR(info["runs"][0]["health"]["marked"].get<double>(), 21.0, 2.0);
}

TEST_F(Workflow, AMissedCycleIsMarkedAndSaid) {
  run_with_fault("miss", "kind: missed_cycle, from_cycle: 1700, run: 2", 3,
                 "1 cycle is missing, 2 samples are marked as invalid: 'stageid log info'");
  succeed("frf miss.slog -o f.h5");
}

TEST_F(Workflow, ReplayGivesTheSameLogAndNoticesADifference) {
  make_log();
  succeed("run " + config_ + " -o again.slog --backend replay --replay run.slog");
  succeed("frf run.slog -o a.h5");
  succeed("frf again.slog -o b.h5");
  EXPECT_EQ(read_frf(at("a.h5")).response, read_frf(at("b.h5")).response);
  const std::string other = experiment("other.yaml", "rms_n: 1.0", "rms_n: 1.001");
  ends("run " + other + " -o c.slog --backend replay --replay run.slog", 3,
       "differ from the recorded ones");
}

TEST_F(Workflow, TheDesignForetellsWhatTheRunDoes) {
  make_log();
  const ExperimentConfig config = load_experiment_config(config_);
  const DesignPrediction prediction =
      predict_closed_loop(make_plan(config), config.stage.spec, config.stage.plant);
  const std::unique_ptr<LogReader> log = open_log(at("run.slog"));
  const auto N = static_cast<std::uint64_t>(log->info().period_samples);
  // Of the last period of all runs, the actuators before the sensors.
  Eigen::RowVectorXd square = Eigen::RowVectorXd::Zero(5), peak = square;
  for (std::size_t run = 0; run < log->runs().size(); ++run) {
    LogSamples last;
    log->read(run, 4 * N, N, last);
    Eigen::MatrixXd all(last.actuators.rows(), 5);
    all << last.actuators, last.sensors;
    square = square.cwiseMax(all.colwise().squaredNorm() / static_cast<double>(N));
    peak = peak.cwiseMax(all.cwiseAbs().colwise().maxCoeff());
  }
  // The remaining transient after four periods of 0.25 s with loops of 20 Hz and a slowly integrating controller, and
  // noise of 1e-9 m with motions of about 1e-6 m.
  constexpr double kTolerance = 0.02;
  std::vector<ChannelPrediction> channels = prediction.actuators;
  channels.insert(channels.end(), prediction.sensors.begin(), prediction.sensors.end());
  ASSERT_EQ(channels.size(), 5U);
  for (Eigen::Index i = 0; i < 5; ++i) {
    const ChannelPrediction& channel = channels[i];
    EXPECT_NEAR(channel.rms, std::sqrt(square[i]), kTolerance * channel.rms);
    EXPECT_NEAR(channel.peak, peak[i], kTolerance * channel.peak);
  }
}

TEST_F(Workflow, AReportComparesWithAnotherDay) {
  make_frf();
  succeed("fit frf.h5 -o model.json --band 120 800");
  succeed("report frf.h5 model.json --compare frf.h5 model.json -o r.html");
  EXPECT_THAT(read_bytes(at("r.html")), HasSubstr(R"("comparison":{)"));
  EXPECT_THAT(read_bytes(at("r.html")), HasSubstr("identical response"));
}

TEST_F(Workflow, EveryCommandSpeaksOneJsonObject) {
  make_frf();
  const std::string commands[] = {"design " + config_ + " -o e.h5",
                                  "run " + config_ + " -o r.slog",
                                  "log info run.slog",
                                  "log verify run.slog",
                                  "log convert run.slog -o r.csv",
                                  "frf run.slog -o f.h5",
                                  "modes frf.h5 -o modes.json",
                                  "fit frf.h5 -o model.json --band 120 800",
                                  "validate model.json frf.h5",
                                  "validate model.json run.slog",
                                  "export model.json -o m.csv",
                                  "report frf.h5 model.json run.slog -o r.html",
                                  "config schema",
                                  "config check " + config_ + " small_stage.yaml",
                                  "identify " + config_ + " -o all"};
  for (const std::string& command : commands) {
    SCOPED_TRACE(command);
    const ProgramResult result = succeed("--json " + command);
    EXPECT_TRUE(json::parse(result.out, nullptr, false).is_object()) << result.out;
  }
}

TEST_F(Workflow, ValidationPredictsTheSamplesOfALog) {
  make_model();
  const json figures = tell("validate model.json run.slog");
  // Small relative to the motion itself; the remainder is transient and noise.
  EXPECT_LT(figures["time_domain"]["normalized"].get<double>(), 0.05);
  EXPECT_EQ(figures["time_domain"]["runs"], 9);
  // A model that is wrong by a factor must not pass.
  AdditiveModel model = read_model(at("model.json"));
  for (Submodel& s : model.submodels)
    for (Eigen::MatrixXd& B : s.numerator) B *= 1.5;
  write_model(at("wrong.json"), model);
  const json wrong = tell("validate wrong.json run.slog", 3);
  EXPECT_EQ(wrong["trustworthy"], false);
  EXPECT_NEAR(wrong["time_domain"]["normalized"].get<double>(), 0.5, 0.05);
}

TEST_F(Workflow, ACompensatedResponseGivesTheSameModes) {
  make_log();
  const auto first_flexible_mode = [&](const std::string& compensate) {
    succeed("frf run.slog -o " + compensate + ".h5 --compensate " + compensate);
    const ProgramResult fit = run("fit " + compensate + ".h5 -o " + compensate +
                                  ".json --direct-term full --modes 3 --json");
    const json modes = json::parse(fit.out)["modes"];
    const auto flexible = std::ranges::find_if(
        modes, [](const json& mode) { return mode["natural_frequency_hz"].get<double>() > 16.0; });
    return (*flexible)["natural_frequency_hz"].get<double>();
  };
  const double measured = first_flexible_mode("none");
  EXPECT_NEAR(first_flexible_mode("delay"), measured, 1e-3 * measured);
  EXPECT_NEAR(first_flexible_mode("hold"), measured, 1e-3 * measured);
}

}  // namespace test_workflow
}  // namespace stageid::test
