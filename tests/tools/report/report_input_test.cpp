#include "tools/report/report_input.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "acquisition/files/file_error.hpp"
#include "frf/file/frf_file.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/tools/report/synthetic_report.hpp"
#include "tools/steps/health_step.hpp"

namespace stageid::test_report_input {

using testing::ElementsAre;

const std::vector<Finding> kFindings = {
    {Severity::unchecked, Cause::skew, "", "timing is not checked", "", "needs two periods"},
    {Severity::fault, Cause::swapped, "a1 a2", "wired crosswise", "0.99", "exchange them"},
    {Severity::doubt, Cause::saturated, "a3", "clips", "3 samples", "less excitation"}};

FrfEstimate response() {
  FrfEstimate frf =
      *test::synthetic_report({.outputs = 2, .inputs = 2, .lines = 60, .modes = 2}).frf;
  frf.noise_dof = 8.0;
  frf.total_dof = 2.0;
  return frf;
}

struct ReportInputTest : testing::Test {
  ReportData read_back(const FrfEstimate& frf) const {
    write_frf(directory_ / "frf.h5", frf);
    return read_report_data(report_input({directory_.path()}));
  }
  const test::TemporaryDirectory directory_;
};

TEST_F(ReportInputTest, FindingsComeFromTheProvenanceOfTheResponse) {
  FrfEstimate frf = response();
  keep_health(frf, kFindings);
  const ReportData data = read_back(frf);
  ASSERT_EQ(data.findings.size(), 3u);
  EXPECT_EQ(data.findings[0].severity, Severity::fault);
  EXPECT_EQ(data.findings[1].severity, Severity::doubt);
  EXPECT_EQ(data.findings[2].severity, Severity::unchecked);
  const Finding& fault = data.findings[0];
  EXPECT_THAT((std::vector{fault.channel, fault.what, fault.figure, fault.remedy}),
              ElementsAre("a1 a2", "wired crosswise", "0.99", "exchange them"));
}

TEST_F(ReportInputTest, AControllerViewIsCheckedBeforeItIsShown) {
  const auto read = [&](const std::string& text) {
    std::ofstream(directory_ / "controller_view.json") << text;
    return read_back(response()).controller_view;
  };
  const std::string sound =
      R"({"format": "stageid-controller-view", "frequency_hz": [1, 2], "determinant": {"re": [1, 2], "im": [null, 4]},)"
      R"( "loops": [{"name": "z", "re": [1, 2], "im": [3, 4], "radius_95": [0, 1]}]})";
  EXPECT_EQ(nlohmann::json::parse(read(sound)), nlohmann::json::parse(sound));
  const auto refused = [&](const std::string& from, const std::string& to, const char* place) {
    std::string text = sound;
    text.replace(text.find(from), from.size(), to);
    EXPECT_THAT(test::error_message<FormatError>([&] { read(text); }), testing::HasSubstr(place));
  };
  refused("\"radius_95\": [0, 1]", "\"radius_95\": [0]", "needs 2 numbers, one per frequency");
  refused("\"im\": [3, 4]", "\"imag\": [3, 4]", "im");
  refused("\"name\": \"z\"", "\"name\": 3", "name");
  refused("\"frequency_hz\": [1, 2], ", "", "frequency_hz");
}

TEST_F(ReportInputTest, AFigureOfTheSummaryThatIsAbsentIsLeftOut) {
  const auto summary = [&](const char* truth) {
    std::ofstream(directory_ / "summary.json")
        << R"({"format": "stageid-summary", "truth": )" << truth
        << R"(, "steps": [{"name": "fit", "seconds": null, "note": null}], "notes": ["n"]})";
    return read_back(response());
  };
  const ReportData absent = summary(R"({"modes": [], "relative_rms_error": null})");
  EXPECT_TRUE(absent.figures.empty());
  ASSERT_EQ(absent.steps.size(), 1u);
  EXPECT_EQ(absent.steps[0].seconds, 0.0);
  EXPECT_EQ(summary(R"({"modes": [], "relative_rms_error": 0.01})").figures.size(), 1u);
  EXPECT_THAT([&] { summary(R"({"modes": [{"true_frequency_hz": null}]})"); },
              testing::ThrowsMessage<FormatError>(testing::HasSubstr(
                  "summary.json:/truth/modes/0/true_frequency_hz: must be a number")));
}

TEST_F(ReportInputTest, AProvenanceThatIsNotOursHasNoFindings) {
  FrfEstimate frf = response();
  for (const char* text : {"{}", "no JSON", R"({"health": 3})"}) {
    frf.provenance_json = text;
    EXPECT_TRUE(read_back(frf).findings.empty()) << text;
  }
}

TEST_F(ReportInputTest, NotesOfTheSummaryThatAreFindingsAreNotToldTwice) {
  FrfEstimate frf = response();
  keep_health(frf, kFindings);
  std::vector<std::string> notes = health_notes(kFindings);
  ASSERT_EQ(notes.size(), 2u);
  notes.push_back("something else");
  std::ofstream(directory_ / "summary.json")
      << nlohmann::json{{"format", "stageid-summary"}, {"notes", notes}};
  const ReportData data = read_back(frf);
  ASSERT_EQ(data.doubts.size(), 1u);
  EXPECT_EQ(data.doubts[0], "something else");
}

TEST_F(ReportInputTest, VerdictsOnLinearityAreThoseOfTheFile) {
  FrfEstimate frf = response();
  ASSERT_EQ(why_linearity_cannot_be_tested(frf), "");  // so they could be computed, otherwise
  frf.nonlinearity.band_hz = Eigen::MatrixXd{{3.0, 5.0}, {6.0, 70.0}};
  frf.nonlinearity.p_value = Eigen::MatrixXd::Constant(4, 2, 0.25);
  frf.nonlinearity.distortion = Eigen::MatrixXd::Constant(4, 2, 0.125);
  frf.nonlinearity.p_value(3, 1) = 1e-7;
  const ReportData data = read_back(frf);
  ASSERT_TRUE(data.nonlinearity.has_value());
  EXPECT_EQ(data.nonlinearity->band_hz, frf.nonlinearity.band_hz);
  EXPECT_EQ(data.nonlinearity->p_value, frf.nonlinearity.p_value);
  EXPECT_EQ(data.nonlinearity->distortion, frf.nonlinearity.distortion);
}

TEST_F(ReportInputTest, AFileWithoutVerdictsIsTestedWhereThatCanBe) {
  FrfEstimate frf = response();
  const ReportData tested = read_back(frf);
  ASSERT_TRUE(tested.nonlinearity.has_value());
  EXPECT_EQ(tested.nonlinearity->p_value, nonlinearity_test(frf).p_value);
  frf.total_dof = 0.0;
  EXPECT_FALSE(read_back(frf).nonlinearity.has_value());
}

}  // namespace stageid::test_report_input
