#include "tools/report/report_verdict.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/report/synthetic_report.hpp"

namespace stageid::test_report_verdict {

using testing::ElementsAre;
using testing::HasSubstr;
using Level = Verdict::Level;

ReportData sound() {
  ReportData data = test::synthetic_report({.outputs = 2, .inputs = 2, .lines = 40, .modes = 4});
  data.findings.clear();
  return data;
}

std::vector<std::string> reasons_of(const Verdict& verdict) {
  std::vector<std::string> out;
  for (const Problem& problem : verdict.problems) out.push_back(problem.text());
  out.insert(out.end(), verdict.remarks.begin(), verdict.remarks.end());
  return out;
}

void expect_level(Level level, const ReportData& data, const char* why) {
  const Verdict verdict = judge(data);
  EXPECT_EQ(verdict.level, level);
  EXPECT_THAT(reasons_of(verdict), ElementsAre(HasSubstr(why)));
}

void expect_doubt(const ReportData& data, const char* why) {
  expect_level(Level::doubt, data, why);
}

void expect_bad(const ReportData& data, const char* why) { expect_level(Level::bad, data, why); }

TEST(Verdict, ASoundResultIsGood) {
  const Verdict verdict = judge(sound());
  EXPECT_EQ(verdict.level, Level::good);
  EXPECT_THAT(reasons_of(verdict), ElementsAre());
}

TEST(Verdict, AFaultOfTheDataIsNotTrustedAndADoubtIsDoubted) {
  ReportData data = sound();
  data.findings = {
      {Severity::unchecked, Cause::incoherent, "", "timing is not checked", "", "two periods"}};
  EXPECT_EQ(judge(data).level, Level::good);
  data.findings.push_back(
      {Severity::doubt, Cause::incoherent, "", "hum", "12 dB", "look at the shield"});
  expect_doubt(data, "hum (12 dB)");
  data.findings.push_back(
      {Severity::fault, Cause::incoherent, "a1 a2", "wired crosswise", "", "exchange them"});
  const Verdict verdict = judge(data);
  EXPECT_EQ(verdict.level, Level::bad);
  EXPECT_THAT(reasons_of(verdict), ElementsAre("a1 a2: wired crosswise. Exchange them",
                                               "hum (12 dB). Look at the shield"));
}

// What `fit` ends with exit code 3 for is not trusted on the page either.
TEST(Verdict, AFitThatEndedBadlyIsNotTrusted) {
  for (const FitStatus status :
       {FitStatus::iteration_limit, FitStatus::cost_stalled, FitStatus::singular,
        FitStatus::undetermined, FitStatus::unexplained, FitStatus::faulty_data}) {
    ReportData data = sound();
    data.model->fit.status = status;
    expect_bad(data, to_string(status));
    data.model->fit.message = "the data have a reason";
    expect_bad(data, "the data have a reason");
  }
}

TEST(Verdict, AnErrorThatNoiseDoesNotExplainIsNotTrusted) {
  ReportData data = sound();
  data.validation->explained = false;
  data.validation->reason = "the residual is 2.5 times what noise explains";
  expect_bad(data, "2.5 times");
}

// The mean of F(2, 2 nu) is 2 for nu = 2: a chi-square of 2.02 is what noise gives.
TEST(Verdict, AnErrorIsComparedWithItsExpectation) {
  ReportData data = sound();
  data.validation->chi_square_per_dof = 2.02;
  data.validation->expected_chi_square = 2.0;
  EXPECT_EQ(judge(data).level, Level::good);
}

TEST(Verdict, LostAndMarkedSamplesAreNotTrusted) {
  ReportData data = sound();
  data.runs[0].health.late = 7;
  EXPECT_EQ(judge(data).level, Level::good);
  data.runs[0].health.missing = 3;
  expect_bad(data, "3 cycles are missing");
  data.runs[0].health.missing = 0;
  data.runs[1].health.marked = 4;
  expect_bad(data, "4 samples are marked");
  data.model.reset();
  expect_doubt(data, "4 samples are marked");
  data.model = sound().model;
  data.runs[1].health.marked = 0;
  data.runs[0].complete = false;
  expect_doubt(data, "incomplete");
}

TEST(Verdict, AMissingModeIsDoubted) {
  ReportData data = sound();
  data.true_modes.push_back({.natural_frequency_hz = 5.0, .damping_ratio = 0.01});
  expect_doubt(data, "5.00 Hz was not identified");
}

TEST(Verdict, AModeThatThePlantDoesNotHaveIsDoubted) {
  ReportData data = sound();
  data.true_modes.erase(data.true_modes.begin());
  expect_doubt(data, "does not exist in the plant");
}

TEST(Verdict, AModeOffTheTruthIsDoubtedOnlyBeyondBothLimits) {
  ReportData data = sound();
  Submodel& mode = data.model->submodels[1];
  const double f = mode.natural_frequency_hz();
  data.true_modes[0].natural_frequency_hz = f * (1.0 + 5e-5);
  mode.natural_frequency_std_hz = 1e-6 * f;  // 50 standard deviations, but 5e-5
  EXPECT_EQ(judge(data).level, Level::good);
  data.true_modes[0].natural_frequency_hz = f * (1.0 + 2e-4);
  expect_doubt(data, "deviates from the true one by");
  mode.natural_frequency_std_hz = 1e-4 * f;
  EXPECT_EQ(judge(data).level, Level::good);
}

TEST(Verdict, ADoubtOfTheJobIsAReasonANoteIsNot) {
  ReportData data = sound();
  data.notes = {"just so"};
  EXPECT_EQ(judge(data).level, Level::good);
  data.doubts = {"careful"};
  expect_doubt(data, "careful");
}

TEST(Verdict, AMeasurementWithoutModelIsNotJudged) {
  ReportData data;
  data.frf = sound().frf;
  EXPECT_EQ(judge(data).level, Level::none);
}

}  // namespace stageid::test_report_verdict
