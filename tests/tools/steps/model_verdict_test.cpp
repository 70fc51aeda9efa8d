#include "tools/steps/model_verdict.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stageid::test_model_verdict {

using testing::ElementsAre;
using testing::HasSubstr;

AdditiveModel fitted_to_drifting_data() {
  AdditiveModel model;
  model.fit.status = FitStatus::gradient_small;
  model.provenance_json = R"({"problems": [{"cause": "drift", "what": "a mode drifts"}]})";
  return model;
}

std::vector<std::string> reasons_of(const ModelVerdict& verdict) {
  std::vector<std::string> out;
  for (const Problem& problem : verdict.problems) out.push_back(problem.text());
  return out;
}

Validation unexplained() {
  Validation validation;
  validation.explained = false;
  validation.variance = ResidualVariance::noise;
  validation.reason = "the residual is 50 times what noise explains";
  return validation;
}

TEST(ModelVerdict, NamesTheCauseBeforeTheResidual) {
  const ModelVerdict verdict = judge_model(fitted_to_drifting_data(), {}, unexplained());
  EXPECT_FALSE(verdict.trustworthy);
  EXPECT_THAT(reasons_of(verdict),
              ElementsAre("a mode drifts", HasSubstr("on held-back data the residual")));
}

TEST(ModelVerdict, TrustsAModelWithDoubtsThatHolds) {
  Validation validation;
  validation.variance = ResidualVariance::noise;
  const ModelVerdict verdict = judge_model(fitted_to_drifting_data(), {}, validation);
  EXPECT_TRUE(verdict.trustworthy);
  EXPECT_TRUE(verdict.validated);
  EXPECT_THAT(reasons_of(verdict), ElementsAre("a mode drifts"));
}

TEST(ModelVerdict, SaysACauseOnceThatTheDataHaveToo) {
  Finding drift;
  drift.severity = Severity::doubt;
  drift.cause = Cause::drift;
  drift.what = "a mode drifts";
  EXPECT_EQ(judge_model(fitted_to_drifting_data(), {drift}, {}).problems.size(), 1U);
}

// The remedy was tried on the data, so that it removes the other reason too.
TEST(ModelVerdict, NamesWhatARefitRemovesBeforeTheFitThatDidNotConverge) {
  AdditiveModel model;
  model.fit.status = FitStatus::cost_stalled;
  model.fit.message = "no step lowers the cost";
  model.fit.distrust({FitStatus::unexplained, "the residual is large", "", "--delay estimate"});
  EXPECT_EQ(model.fit.status, FitStatus::cost_stalled);
  EXPECT_EQ(model.fit.message, "the residual is large; no step lowers the cost");
  model.provenance_json =
      R"({"options": {"flags": {"--delay": "0", "--rigid-body": "none", "--modes": "1,2"}}})";
  ResultFiles files;
  files.frf = "a b.h5";
  files.model = "m.json";
  const ModelVerdict verdict = judge_model(model, {}, {}, {}, files);
  EXPECT_THAT(reasons_of(verdict), ElementsAre("the residual is large", "no step lowers the cost"));
  EXPECT_EQ(verdict.problems[0].cause, "delay");
  EXPECT_EQ(verdict.problems[0].command,
            "stageid fit 'a b.h5' -o m.json --rigid-body none --modes 1,2 --delay estimate");
  EXPECT_THAT(verdict_lines(verdict),
              ElementsAre("verdict: not to be trusted: the residual is large:",
                          "    " + verdict.problems[0].command))
      << "more iterations are no remedy beside another one";
}

TEST(ModelVerdict, NamesTheKeysOfTheExperimentThatSayTheSame) {
  const auto remedy = [](const char* flags) {
    AdditiveModel model;
    model.fit.status = FitStatus::gradient_small;
    model.fit.distrust({FitStatus::unexplained, "the residual is large", "", flags});
    ResultFiles files;
    files.frf = "f.h5";
    files.model = "m.json";
    files.experiment = "e.yaml";
    return judge_model(model, {}, {}, {}, files).problems[0].remedy;
  };
  EXPECT_EQ(remedy("--delay estimate"),
            "for later measurements, write 'delay_s: estimate' under 'fit' in e.yaml");
  EXPECT_THAT(remedy("--rigid-body suspension --modes auto"),
              HasSubstr("write 'rigid_body: suspension' and 'modes: auto' under"));
  EXPECT_THAT(remedy("--band 30 2000"), HasSubstr("write 'band_hz: [30, 2000]' under"));
}

// A command is copied into a shell, and a model may be of somebody else.
TEST(ModelVerdict, QuotesWhatAModelOfOthersPutsIntoACommand) {
  AdditiveModel model;
  model.fit.status = FitStatus::gradient_small;
  model.fit.distrust({FitStatus::unexplained, "the residual is large", "", "--delay $(reboot)"});
  model.provenance_json = R"({"options": {"flags": {"--modes": "1;reboot", "--band": "1 2|sh"}}})";
  ResultFiles files;
  files.frf = "it's.h5";
  files.model = "m.json";
  EXPECT_EQ(
      judge_model(model, {}, {}, {}, files).problems[0].command,
      R"(stageid fit 'it'\''s.h5' -o m.json --modes '1;reboot' --band 1 '2|sh' --delay '$(reboot)')");
}

TEST(ModelVerdict, AFaultOfTheDataComesFirstAndFillsTheHead) {
  Finding dead;
  dead.severity = Severity::fault;
  dead.channel = "z1";
  dead.what = "dead";
  const ModelVerdict verdict = judge_model(fitted_to_drifting_data(), {dead}, {});
  EXPECT_THAT(reasons_of(verdict), ElementsAre(HasSubstr("z1: dead"), "a mode drifts"));
  EXPECT_THAT(verdict_lines(verdict), ElementsAre("verdict: not to be trusted: z1: dead"));
  const ModelVerdict other = judge_model(fitted_to_drifting_data(), {dead}, unexplained());
  ASSERT_EQ(other.problems.size(), 3U);
  EXPECT_THAT(other.problems.front().what, HasSubstr("z1: dead"));
}

TEST(ModelVerdict, DistrustsARecordingThatLostSamples) {
  LogRun first, second;
  first.health.missing = 3;
  first.health.late = 7;  // these are marked as well
  second.health.marked = 8;
  const ModelVerdict verdict = judge_model(fitted_to_drifting_data(), {}, {}, {first, second});
  EXPECT_FALSE(verdict.trustworthy);
  EXPECT_THAT(reasons_of(verdict),
              ElementsAre(HasSubstr("3 cycles are missing"),
                          HasSubstr("8 samples are marked as invalid"), "a mode drifts"));
}

TEST(ModelVerdict, TrustsARecordingThatWasInterruptedAndResumed) {
  LogRun stopped, again;
  stopped.complete = false;
  stopped.health.marked = 200;  // the ramp of the stop
  EXPECT_TRUE(judge_model(fitted_to_drifting_data(), {}, {}, {stopped, again}).trustworthy);
}

}  // namespace stageid::test_model_verdict
