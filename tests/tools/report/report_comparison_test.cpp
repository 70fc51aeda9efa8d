#include "tools/report/report_comparison.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/support/process/error_message.hpp"
#include "tests/tools/report/synthetic_report.hpp"

namespace stageid::report {
namespace test_report_comparison {

using nlohmann::json;
using testing::HasSubstr;

ReportData small() {
  return test::synthetic_report({.outputs = 2, .inputs = 3, .lines = 50, .modes = 3});
}

std::string refusal(ReportData own, std::optional<AdditiveModel> model,
                    const std::optional<FrfEstimate>& frf) {
  return test::error_message<std::invalid_argument>(
      [&] { make_comparison(own, "Tuesday", std::move(model), frf); });
}

TEST(ReportComparison, RefusesOtherChannelsAndAReportOfNothing) {
  const ReportData own = small();
  AdditiveModel model = *own.model;
  model.inputs.names[1] = "elsewhere";
  EXPECT_THAT(refusal(own, model, {}), HasSubstr("Tuesday: its channels differ from those"));
  FrfEstimate frf = *own.frf;
  std::swap(frf.outputs.names[0], frf.outputs.names[1]);
  EXPECT_THAT(refusal(own, {}, frf), HasSubstr("Tuesday"));
  EXPECT_THAT(refusal(ReportData(), own.model, {}), HasSubstr("--compare"));
  EXPECT_EQ(refusal(own, own.model, own.frf), "no error");
}

TEST(ReportComparison, DrawsAResponseOnlyOnTheLinesOfTheReport) {
  ReportData own = small();
  FrfEstimate other = *own.frf;
  other.response *= 1.01;
  ReportComparison made = make_comparison(own, "Tuesday", {}, other);
  EXPECT_EQ(made.response, other.response);
  EXPECT_TRUE(own.notes.empty());

  own.frf = select_band(*own.frf, 200.0, 900.0);
  made = make_comparison(own, "Tuesday", {}, other);
  EXPECT_EQ(made.response, select_band(other, 200.0, 900.0).response);

  other.frequency_hz *= 1.001;
  made = make_comparison(own, "Tuesday", {}, other);
  EXPECT_EQ(made.response.size(), 0);
  ASSERT_EQ(own.notes.size(), 1u);
  EXPECT_THAT(own.notes[0], HasSubstr("its lines differ"));
}

TEST(ReportComparison, LeavesOutWhatIsTheSameOrCompensatedOtherwise) {
  ReportData own = small();
  EXPECT_EQ(make_comparison(own, "a", {}, own.frf).response.size(), 0);
  EXPECT_THAT(own.notes.back(), HasSubstr("identical response"));
  FrfEstimate other = *own.frf;
  other.response *= 1.01;
  other.compensated = Compensation::delay;
  EXPECT_EQ(make_comparison(own, "b", {}, other).response.size(), 0);
  EXPECT_THAT(own.notes.back(), HasSubstr("hold or delay compensation differs"));
}

TEST(ReportComparison, PairsModesAndTellsChangesInDeviationsOfTheDifference) {
  ReportData own = small();
  AdditiveModel other = *own.model;
  Submodel& mode = other.submodels[2];  // the second mode; 0 is the rigid body
  const double before = mode.natural_frequency_hz();
  mode.denominator[2] /= 1.001 * 1.001;
  mode.denominator[1] /= 1.001;
  mode.natural_frequency_std_hz = 3e-2;
  const Submodel& same = own.model->submodels[2];
  own.comparison = make_comparison(own, "Tuesday", other, {});
  const json got = comparison_json(own);
  ASSERT_EQ(got["pairs"].size(), 3u);
  const json& pair = got["pairs"][1];
  EXPECT_NEAR(pair["frequency_difference"].get<double>(), 1e-3, 1e-12);
  const double sigma = std::hypot(3e-2, *same.natural_frequency_std_hz);
  EXPECT_NEAR(pair["frequency_deviation"].get<double>(), 1e-3 * before / sigma, 1e-9 * before);
  EXPECT_NEAR(pair["damping_difference"].get<double>(), 0.0, 1e-12);
  EXPECT_NEAR(got["output_mac"][1][1].get<double>(), 1.0, 1e-4);
  own.comparison->model->submodels[2].natural_frequency_std_hz.reset();
  EXPECT_TRUE(comparison_json(own)["pairs"][1]["frequency_deviation"].is_null());
  own.comparison->model.reset();
  EXPECT_FALSE(comparison_json(own).contains("pairs"));
}

}  // namespace test_report_comparison
}  // namespace stageid::report
