// Output of stageid frf on linearity and periods, end to end.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "frf/file/frf_file.hpp"
#include "tests/support/logs/hdf5_surgery.hpp"
#include "tests/tools/program_fixture.hpp"
#include "tools/fit/frf_quality.hpp"
#include "tools/steps/health_step.hpp"

namespace stageid::test {
namespace test_frf_quality {

using nlohmann::json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

class FrfQuality : public ProgramTest {};

TEST_F(FrfQuality, TellsWhetherTheStageIsLinear) {
  make_log();
  const ProgramResult linear = succeed("frf run.slog -o f.h5 --json");
  EXPECT_THAT(linear.err, HasSubstr("nonlinear pairs"));
  EXPECT_EQ(json::parse(linear.out)["nonlinearity"]["tested"], true);
  const std::string config =
      stage("cubic.yaml", "  plate:", "  cubic_stiffness_n_m3: 1.0e+16\n  plate:");
  // A distorted stage needs longer to settle.
  write_bytes(config, replaced(read_bytes(config), "transient_periods: 2", "transient_periods: 8"));
  succeed("run " + config + " -o cubic.slog");
  const ProgramResult cubic = succeed("frf cubic.slog -o c.h5 --json");
  const json found = json::parse(cubic.out)["nonlinearity"];
  EXPECT_EQ(found["nonlinear"], true);
  EXPECT_GT(found["bands"][0]["distortion"].get<double>(), 0.0);
  EXPECT_THAT(cubic.err, HasSubstr("the plant is nonlinear: of a linear plant "));
  EXPECT_THAT(cubic.err, HasSubstr("but the smallest p value here is "));
  EXPECT_THAT(linear.err, HasSubstr("no evidence of nonlinearity: of a linear plant "));
  EXPECT_LT(read_frf(at("c.h5")).nonlinearity.p_value.minCoeff(),
            read_frf(at("f.h5")).nonlinearity.p_value.minCoeff());
}

TEST_F(FrfQuality, SaysWhereTheRecordsAreNotSettled) {
  make_log();
  succeed("frf run.slog -o f.h5");
  FrfEstimate frf = read_frf(at("f.h5"));
  const Eigen::Index bands = frf.nonlinearity.band_hz.rows();
  frf.nonlinearity.settled_p_value = Eigen::VectorXd::Ones(bands);
  frf.nonlinearity.settled_p_value[0] = 1e-5;
  EXPECT_THAT(linearity_lines(frf), Contains(HasSubstr("not settled")));
  EXPECT_THAT(linearity_lines(frf), Contains(HasSubstr("linearity cannot be tested")));
  EXPECT_EQ(quality_json(frf)["nonlinearity"]["bands"][0]["settled"], false);
  const std::vector<Finding> found = keep_health(frf, {});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].cause, Cause::unsettled);
  EXPECT_EQ(health_of(frf.provenance_json).front().cause, Cause::unsettled);
  frf.nonlinearity.settled_p_value.setConstant(1e-5);
  EXPECT_THAT(linearity_lines(frf), testing::Not(Contains(HasSubstr("the plant is nonlinear"))));
}

TEST_F(FrfQuality, SaysWhyItWasNotTested) {
  make_log();
  const ProgramResult one = succeed("frf run.slog -o f.h5 --realizations 1 --json");
  EXPECT_THAT(one.err, HasSubstr("measure two realizations"));
  EXPECT_EQ(json::parse(one.out)["nonlinearity"]["tested"], false);
  const ProgramResult lpm = succeed("frf run.slog -o f.h5 --method lpm");
  EXPECT_THAT(lpm.err, HasSubstr("estimate with 'periodic'"));
}

/// `signal` of the first runs is zero, on all its channels.
void silence(const std::filesystem::path& file, const std::string& signal, hsize_t channels,
             int runs) {
  constexpr hsize_t kSamples = 2500;
  Hdf5Surgery log(file);
  for (int run = 0; run < runs; ++run)
    log.reshape(fmt::format("/runs/{:04}/{}", run, signal), {kSamples, channels});
}

TEST_F(FrfQuality, ChannelsWithoutASignalAreNamed) {
  make_log();
  succeed("log convert run.slog -o sensors.h5");
  succeed("log convert run.slog -o actuators.h5");
  Hdf5Surgery(at("sensors.h5")).remove("/runs/0008");
  silence(at("sensors.h5"), "sensors", 2, 8);
  const json told =
      json::parse(ends("frf sensors.h5 -o f.h5 --json", 3, "no complete run of experiment 3").out);
  EXPECT_EQ(told["health"][0]["cause"], "dead");
  EXPECT_EQ(told["health"][0]["channel"], "s1");
  // The last realization lacks an experiment.
  EXPECT_EQ(told["left_out_realizations"][0]["realization"], 3);
  EXPECT_EQ(read_frf(at("f.h5")).left_out_realizations.size(), 1u);
  EXPECT_EQ(read_frf(at("f.h5")).nonlinearity.distortion.maxCoeff(), 0.0);
  silence(at("actuators.h5"), "actuators", 3, 9);
  fail("frf actuators.h5 -o g.h5", 2, "channel a1 is constant");
}

TEST_F(FrfQuality, SmoothsTheCovariance) {
  make_log();
  succeed("frf run.slog -o one.h5");
  succeed("frf run.slog -o nine.h5 --smooth-covariance 9");
  EXPECT_EQ(read_frf(at("nine.h5")).noise_dof, 9.0 * read_frf(at("one.h5")).noise_dof);
}

TEST(DroppedLines, TellALeftOutRealizationOnceAndNotEachOfItsPeriods) {
  FrfEstimate frf;
  frf.left_out_realizations = {{1, "run.slog:/runs/0003: no clean period"}};
  frf.dropped_periods = {{0, 2, 4, "a glitch"}};
  for (int period = 0; period < 30; ++period)
    frf.dropped_periods.push_back({1, 0, period, "marked"});
  frf.replaced_samples = {{1, 1, 2, 50, 6, "a spike"}};
  EXPECT_THAT(
      dropped_lines(frf),
      ElementsAre(
          "realization 2 discarded, the others are used: run.slog:/runs/0003: no clean period",
          "realization 1, experiment 3: period 5 discarded: a glitch"));
  EXPECT_EQ(quality_json(frf)["left_out_realizations"],
            json({{{"realization", 2}, {"reason", "run.slog:/runs/0003: no clean period"}}}));
  frf.left_out_realizations.clear();
  EXPECT_THAT(dropped_lines(frf), Contains("realization 2, experiment 2: samples 51 ... 56 of "
                                           "period 3 replaced, the others are used: a spike"));
  EXPECT_THAT(dropped_lines(frf), Contains("... and 21 more periods, listed in /dropped_periods"));
}

TEST(DroppedLines, TellWhichSamplesWereReplaced) {
  FrfEstimate frf;
  frf.replaced_samples = {{0, 2, 4, 99, 6, "a glitch"}};
  EXPECT_THAT(dropped_lines(frf),
              ElementsAre("realization 1, experiment 3: samples 100 ... 105 of period 5 replaced, "
                          "the others are used: a glitch"));
  EXPECT_EQ(quality_json(frf)["replaced_samples"].dump(),
            R"([{"realization":1,"experiment":3,"period":5,"first_sample":100,"samples":6,)"
            R"("reason":"a glitch"}])");
  frf.replaced_samples.resize(13, frf.replaced_samples.front());
  EXPECT_THAT(dropped_lines(frf),
              Contains("... and 3 more replacements, listed in /replaced_samples"));
}

TEST(DroppedLines, SayThatTheTransientLasts) {
  const auto told =
      testing::StartsWith("the first measured period of 3 of 4 experiments was discarded");
  FrfEstimate frf;
  frf.realizations = 2;
  frf.experiments = 2;
  EXPECT_THAT(dropped_lines(frf), testing::IsEmpty());
  frf.dropped_periods = {{0, 0, 0, "unlike"}, {0, 1, 0, "unlike"}, {1, 0, 2, "unlike"}};
  EXPECT_THAT(dropped_lines(frf), testing::Not(Contains(told)));
  frf.dropped_periods.back().period = 0;
  EXPECT_THAT(dropped_lines(frf), Contains(told));
  frf.dropped_periods.push_back({1, 1, 2, "a glitch"});
  EXPECT_THAT(dropped_lines(frf), Contains(told));
  for (int period = 4; period < 10; period += 2)
    frf.dropped_periods.push_back({1, 1, period, "a glitch"});
  EXPECT_THAT(dropped_lines(frf), testing::Not(Contains(told)));
}

// A slow transient costs several periods of each run.
TEST(DroppedLines, CountTheRunsOfWhichTheFirstPeriodsWereDiscarded) {
  FrfEstimate frf;
  frf.realizations = 1;
  frf.experiments = 3;
  for (int experiment = 0; experiment < 3; ++experiment)
    for (int period = 0; period < 3; ++period)
      frf.dropped_periods.push_back({0, experiment, period, "unlike"});
  EXPECT_THAT(dropped_lines(frf),
              Contains(testing::StartsWith("the first measured period of 3 of 3 experiments")));
}

}  // namespace test_frf_quality
}  // namespace stageid::test
