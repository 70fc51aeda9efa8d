// From a pilot to the largest multisines that the limits allow, on the real program; and the pieces between.
#include "tools/experiment/limited_plan.hpp"
#include "tools/experiment/plant_prior_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquisition/files/file_error.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/prediction/closed_loop_prediction.hpp"
#include "acquisition/record/log_reader.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/response/confidence.hpp"
#include "tests/tools/experiment/exact_pilot.hpp"
#include "tests/tools/program_fixture.hpp"
#include "tools/experiment/config_plan.hpp"

namespace stageid::test {
namespace test_limited_plan {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;

struct LimitedPlanTest : ProgramTest {
  LimitedPlanTest() {
    for (const char* file : {"small_stage_pilot.yaml", "small_stage_limits.yaml"})
      write_bytes(at(file), replaced(read_bytes(std::filesystem::path(STAGEID_SOURCE_DIR) /
                                                "configs/experiment" / file),
                                     "../stage/small_stage.yaml", "small_stage.yaml"));
    limits_ = name("small_stage_limits.yaml");
  }
  void make_pilot() const {
    succeed("run small_stage_pilot.yaml -o pilot.slog");
    succeed("frf pilot.slog --method lpm -o " + prior());
  }
  std::string prior() const { return name("small_stage_pilot_frf.h5"); }
  std::string variant(const std::string& from, const std::string& to) const {
    write_bytes(at("variant.yaml"), replaced(read_bytes(limits_), from, to));
    return name("variant.yaml");
  }
  std::string limits_;
};

TEST_F(LimitedPlanTest, WhatIsForetoldFromThePilotHolds) {
  make_pilot();
  const Json design = tell("design " + limits_ + " -o e.h5 --accuracy 1e-7");
  double most = 0.0;
  for (const Json& signal : design["signals"]) most = std::max(most, signal["used"].get<double>());
  EXPECT_NEAR(most, 0.9, 1e-6);
  EXPECT_EQ(design["signals"].size(), 7U);  // |u| and rms of 3, y and its velocity of 2
  const double variance = design["relative_variance"];
  // Whole realizations of 3 runs of 1.25 s, each as good as the other.
  EXPECT_NEAR(design["seconds_to_accuracy"], 3.75 * std::ceil(3.0 * variance / 1e-7), 1e-9);

  succeed("run " + limits_ + " --excitation e.h5 -o r.slog");
  succeed("frf r.slog -o r.h5");
  const double reached = mean_relative_variance(read_frf(at("r.h5")), VarianceKind::noise);
  // The pilot of 1.5 s estimates the noise of a line from about 20 lines, and its own noise is in |G|.
  EXPECT_GT(reached, variance / 1.6);
  EXPECT_LT(reached, variance * 1.6);
}

/// Largest |y| of all runs of a log.
Eigen::VectorXd largest_position(const std::filesystem::path& file) {
  const auto log = open_log(file);
  Eigen::VectorXd largest =
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(log->info().sensors.names.size()));
  LogSamples samples;
  for (std::size_t run = 0; run < log->runs().size(); ++run) {
    log->read(run, 0, log->runs()[run].samples, samples);
    largest = largest.cwiseMax(samples.sensors.cwiseAbs().colwise().maxCoeff().transpose());
  }
  return largest;
}

// A position window limits the first period, because of motion below the band: the loop at 20 Hz is not visible in a
// band or a pilot from 50 Hz.
TEST_F(LimitedPlanTest, PositionsFromRestAreForetoldBelowTheBandToo) {
  const std::string stage = read_bytes(at("small_stage.yaml"));
  for (const char* pilot_band : {"[4, 800]", "[52, 800]"}) {
    const std::string pilot = read_bytes(at("small_stage_pilot.yaml"));
    write_bytes(at("small_stage_pilot.yaml"), replaced(pilot, "[4, 800]", pilot_band));
    make_pilot();
    write_bytes(at("small_stage_pilot.yaml"), pilot);
    write_bytes(at("small_stage.yaml"), replaced(stage, "window_m: 1e-3", "window_m: 3e-6"));
    const std::string narrow = variant("[16, 800]", "[52, 800]");
    const Json design = tell("design " + narrow + " -o e.h5");
    succeed("run " + narrow + " --excitation e.h5 -o r.slog");  // nothing was hit
    const Eigen::VectorXd reached = largest_position(at("r.slog"));
    double most = 0.0;
    for (const Json& signal : design["signals"]) {
      if (signal["of"] != "value" || signal["unit"] != "m") continue;
      const double foretold = signal["peak_from_rest"];
      EXPECT_GT(foretold, signal["peak"].get<double>());
      const double y = reached[signal["name"] == "s1" ? 0 : 1];
      EXPECT_LT(y, foretold + signal["reserve"].get<double>());
      EXPECT_GT(y, 0.9 * foretold);
      most = std::max(most, signal["used"].get<double>());
    }
    EXPECT_NEAR(most, 0.9, 1e-6);
    EXPECT_EQ(design.contains("extrapolated"), true);
    for (const char* file : {"pilot.slog", "r.slog"}) std::filesystem::remove(at(file));
    write_bytes(at("small_stage.yaml"), stage);
  }
}

// Against the exact sampled plant of the stage, far below the lines that are known.
TEST_F(LimitedPlanTest, BelowItsLinesAPriorIsARigidBodyWithCompliance) {
  const StageConfig stage = load_stage_config(at("small_stage.yaml"));
  const auto write_prior = [&](double low_hz, double high_hz) {
    write_frf(at("prior.h5"), exact_pilot(stage, Eigen::VectorXd::LinSpaced(60, low_hz, high_hz)));
  };
  write_prior(50.0, 286.0);  // over the modes from 170 Hz on
  const Eigen::VectorXd below{{5.0, 20.0, 40.0}};
  const Eigen::VectorXd lines{{60.0, 100.0}};
  const PlantPrior prior = read_plant_prior(at("prior.h5"), stage.spec.info, lines, below);
  EXPECT_EQ(prior.extrapolated_below_hz, 50.0);
  EXPECT_LT(prior.extrapolation_misfit, 0.02);
  const FrfEstimate exact = exact_pilot(stage, below);
  for (Eigen::Index b = 0; b < below.size(); ++b) {
    const Eigen::MatrixXcd G = exact.response.col(b).reshaped(2, 3);
    EXPECT_LT((prior.below_band[b] - G).norm(), 0.03 * G.norm());
  }
  const PlantPrior all = read_plant_prior(at("prior.h5"), stage.spec.info, lines);
  EXPECT_EQ(all.extrapolated_below_hz, 0.0);
  EXPECT_TRUE(all.below_band.empty());

  write_prior(150.0, 209.0);  // nothing of the rigid body
  const PlantPrior doubtful =
      read_plant_prior(at("prior.h5"), stage.spec.info, Eigen::VectorXd{{160.0, 180.0}}, below);
  EXPECT_GT(doubtful.extrapolation_misfit, 0.05);
}

TEST_F(LimitedPlanTest, RunEndsWhenTheVarianceIsReachedAndGoesOnWithResume) {
  make_pilot();
  const std::string log = "r.slog";
  // 9 runs of 3 realizations leave 1.0e-6: two of them are enough for 2e-6.
  const Json first = tell("run " + limits_ + " -o " + log + " --until 2e-6");
  EXPECT_EQ(first["runs_complete"], 6);
  EXPECT_LE(first["relative_variance"].get<double>(), 2e-6);
  EXPECT_THAT(first["message"].get<std::string>(), HasSubstr("target 2e-06"));
  EXPECT_EQ(first["exit_code"], 0);
  succeed("log verify " + log);
  const Json same = tell("run " + limits_ + " -o " + log + " --until 2e-6 --resume");
  EXPECT_EQ(same["runs_complete"], 6);
  const Json rest = tell("run " + limits_ + " -o " + log + " --until 1e-12 --resume");
  EXPECT_EQ(rest["runs_complete"], 9);
  EXPECT_THAT(rest["message"].get<std::string>(), HasSubstr("the plan ended"));
  // A measurement that was stopped and resumed equals an uninterrupted one.
  succeed("run " + limits_ + " -o whole.slog");
  succeed("frf " + log + " -o a.h5");
  succeed("frf whole.slog -o b.h5");
  EXPECT_EQ(read_frf(at("a.h5")).response, read_frf(at("b.h5")).response);
}

TEST_F(LimitedPlanTest, UntilWarnsOfAPlanThatCannotEndEarly) {
  const auto warning = [&](const std::string& from, const std::string& to) {
    const std::string short_plan =
        replaced(read_bytes(config_), "validation:\n  realization: 3", "");
    write_bytes(at("short.yaml"), replaced(short_plan, from, to));
    return run("run short.yaml -o short.slog --until 1e-12 --pace 0").err;
  };
  const std::string plan = "  periods: 3\n  realizations: 3";
  EXPECT_THAT(warning(plan, "  periods: 1\n  realizations: 1"),
              AllOf(HasSubstr("--until: one period of one realization has no variance estimate"),
                    HasSubstr("set realizations to 2 or more")));
  std::filesystem::remove(at("short.slog"));
  EXPECT_THAT(warning(plan, "  periods: 3\n  realizations: 1"), HasSubstr("the plan has only one"));
  std::filesystem::remove(at("short.slog"));
  EXPECT_THAT(warning(plan, "  periods: 1\n  realizations: 2"), Not(HasSubstr("--until")));
}

TEST_F(LimitedPlanTest, RequestsThatAreWrong) {
  fail("run " + config_ + " -o x.slog --until -1", 2, "--until");
  const auto wrong = [&](const std::string& from, const std::string& to, const std::string& text) {
    fail("design " + variant(from, to) + " -o e.h5", 2, text);
  };
  wrong("crest_iterations: 20", "crest_iterations: 0", "'limits' also optimizes the phases");
  wrong("  lines: all", "  shape: [[1, 1], [10, 2]]\n  lines: all", "remove 'shape'");
  wrong("velocity_m_s: 0.05", "velocity_m_s: 0.05, safety: 1.5", "safety: 1.5 is out of range");
  make_pilot();
  wrong("[16, 800]", "[16, 900]", "do not cover the band");
  wrong("velocity_m_s: 0.05", "velocity_m_s: 1e-9", "uses up the limit");
  succeed("design " + limits_ + " -o e.h5");
  fail("run " + config_ + " --excitation e.h5 -o x.slog", 2, "differs in the scheme from");
  fail("run " + limits_ + " --excitation " + prior() + " -o x.slog", 2,
       "is a frequency response, not a designed excitation;");
}

TEST_F(LimitedPlanTest, APriorOfAnotherStageIsRefused) {
  const StageInfo stage = load_stage_config(at("small_stage.yaml")).spec.info;
  const Eigen::VectorXd lines = Eigen::VectorXd::LinSpaced(5, 100.0, 200.0);
  FrfEstimate frf;
  frf.frequency_hz = lines;
  frf.inputs = {{"a1", "a2"}, {"N", "N"}};
  frf.outputs = {{"s1"}, {"m"}};
  frf.response = Eigen::MatrixXcd::Ones(2, 5);
  frf.sample_rate_hz = stage.sample_rate_hz;
  frf.hold = Hold::zoh;
  const auto refused = [&](const char* text) {
    write_frf(at("prior.h5"), frf);
    EXPECT_THAT([&] { read_plant_prior(at("prior.h5"), stage, lines); },
                testing::ThrowsMessage<FormatError>(HasSubstr(text)));
  };
  write_frf(at("prior.h5"), frf);
  const PlantPrior good = read_plant_prior(at("prior.h5"), stage, lines);
  EXPECT_EQ(good.response[2](0, 1), 1.0);
  EXPECT_EQ(good.response[2](1, 0), 0.0);
  EXPECT_EQ(good.sensor_known, std::vector<bool>({true, false}));
  EXPECT_EQ(good.noise_density.size(), 0);
  frf.sample_rate_hz = 1000.0;
  refused("expected a response through the hold at 2000 Hz");
  frf.sample_rate_hz = stage.sample_rate_hz;
  frf.inputs.names[0] = "z1";
  refused("has the actuator 'z1', which the stage lacks");
}

// Through other code, from the stage's own plant: the steady state of every run, to rounding.
TEST_F(LimitedPlanTest, WithTheExactPlantThePredictionIsThatOfTheStage) {
  const ExperimentConfig config = load_experiment_config(config_);
  const ExperimentPlan plan = make_plan(config);
  const StageSpec& stage = config.stage.spec;
  PlantPrior exact;
  const FrfEstimate pilot = exact_pilot(config.stage, plan.grid().frequency_hz());
  for (const auto& column : pilot.response.colwise())
    exact.response.push_back(column.reshaped(2, 3));
  exact.sensor_known.assign(2, true);
  exact.actuator_known.assign(3, true);
  const BoundedLoop loop =
      bounded_loop(plan.grid(), plan.spec(), stage, exact, {}, Eigen::VectorXd());
  const DesignPrediction other = predict_closed_loop(plan, stage, config.stage.plant);
  std::vector<SignalPeak> peaks(loop.signals.size());
  SignalPredictor predictor(plan.grid());
  for (const RunId run : plan.runs()) {
    const auto one = predictor.predict(loop.signals, plan.spectrum(run));
    for (std::size_t s = 0; s < one.size(); ++s) peaks[s].include(one[s]);
  }
  ASSERT_EQ(loop.signals.size(), 5U);
  for (std::size_t s = 0; s < 5; ++s) {
    const ChannelPrediction& channel = s < 3 ? other.actuators[s] : other.sensors[s - 3];
    EXPECT_EQ(loop.signals[s].name, channel.name);
    EXPECT_GE(peaks[s].steady, channel.peak);
    // The lines reach 0.8 of Nyquist: a good deal lies between the samples of `other`.
    EXPECT_LT(peaks[s].steady, 1.4 * channel.peak);
    if (s < 3) continue;
    EXPECT_NEAR(peaks[s].rms, channel.rms, 1e-9 * channel.rms);
  }
  EXPECT_FALSE(loop.noise_known);
  PlantPrior blind = exact;
  blind.actuator_known[1] = false;
  EXPECT_THROW(bounded_loop(plan.grid(), plan.spec(), stage, blind, {}, Eigen::VectorXd()),
               std::invalid_argument);
  EXPECT_THROW(bounded_loop(plan.grid(), plan.spec(), stage, exact, {"s9"}, Eigen::VectorXd()),
               std::invalid_argument);
}

}  // namespace test_limited_plan
}  // namespace stageid::test
