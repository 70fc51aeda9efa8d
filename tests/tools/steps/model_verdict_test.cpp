#include "tools/steps/model_verdict.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stageid {
namespace test_model_verdict {

using testing::ElementsAre;
using testing::HasSubstr;

AdditiveModel fitted_to_drifting_data() {
  AdditiveModel model;
  model.fit.status = FitStatus::gradient_small;
  model.provenance_json = R"({"doubts": ["a mode drifts"]})";
  return model;
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
  EXPECT_THAT(verdict.reasons,
              ElementsAre("a mode drifts", HasSubstr("on held-back data the residual")));
}

TEST(ModelVerdict, TrustsAModelWithDoubtsThatHolds) {
  Validation validation;
  validation.variance = ResidualVariance::noise;
  const ModelVerdict verdict = judge_model(fitted_to_drifting_data(), {}, validation);
  EXPECT_TRUE(verdict.trustworthy);
  EXPECT_TRUE(verdict.validated);
  EXPECT_THAT(verdict.reasons, ElementsAre("a mode drifts"));
}

TEST(ModelVerdict, SaysACauseOnceThatTheFitHasNamed) {
  AdditiveModel model = fitted_to_drifting_data();
  model.fit.status = FitStatus::unexplained;
  model.fit.message = "a mode drifts; the residual is 9 times what noise explains";
  EXPECT_THAT(judge_model(model, {}, {}).reasons, ElementsAre(model.fit.message));
}

TEST(ModelVerdict, PutsFaultsOfOtherDataFirst) {
  Finding dead;
  dead.severity = Severity::fault;
  dead.channel = "z1";
  dead.what = "dead";
  const ModelVerdict verdict = judge_model(fitted_to_drifting_data(), {dead}, unexplained());
  ASSERT_EQ(verdict.reasons.size(), 3U);
  EXPECT_THAT(verdict.reasons.front(), HasSubstr("z1: dead"));
}

TEST(ModelVerdict, DistrustsARecordingThatLostSamples) {
  LogRun first, second;
  first.health.missing = 3;
  first.health.late = 7;  // these are marked as well
  second.health.marked = 8;
  const ModelVerdict verdict = judge_model(fitted_to_drifting_data(), {}, {}, {first, second});
  EXPECT_FALSE(verdict.trustworthy);
  EXPECT_THAT(verdict.reasons, ElementsAre("3 cycles are missing",
                                           "8 samples are marked as invalid", "a mode drifts"));
}

TEST(ModelVerdict, TrustsARecordingThatWasInterruptedAndResumed) {
  LogRun stopped, again;
  stopped.complete = false;
  stopped.health.marked = 200;  // the ramp of the stop
  EXPECT_TRUE(judge_model(fitted_to_drifting_data(), {}, {}, {stopped, again}).trustworthy);
}

}  // namespace test_model_verdict
}  // namespace stageid
