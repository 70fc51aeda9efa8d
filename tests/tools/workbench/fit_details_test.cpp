#include "tools/workbench/fit_details.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "acquisition/files/fingerprint.hpp"
#include "frf/file/frf_file.hpp"
#include "tests/tools/program_fixture.hpp"
#include "tools/exchange/model/model_hdf5.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/workbench/model_request.hpp"

namespace stageid::test_fit_details {

using Json = nlohmann::json;

struct FitDetailsTest : test::ProgramTest {
  /// What the workbench makes of the request of model.json.
  std::shared_ptr<const FitDetails> of_fit(const StageConfig* stage) const {
    const FrfEstimate frf = read_frf(at("frf.h5"));
    const FitSetup setup = make_fit_setup(request_of(read_model(at("model.json"))), frf);
    return details_of_fit(setup, complete_fit(setup, setup.options, "frf.h5", ""), frf, stage);
  }
  StageConfig stage_file() const { return load_stage_config(at("small_stage.yaml")); }
  static Json margin(const std::string& loop) {
    return Json::parse(loop)["loops"][0]["phase_margin_deg"];
  }
};

TEST_F(FitDetailsTest, BandAndLoopAreThoseOfTheCommands) {
  make_model();
  succeed("fit frf.h5 -o same.json --band 120 800 --direct-term full --covariance covariance.h5");
  succeed(
      "export same.json --controller-view small_stage.yaml --covariance covariance.h5 --frf frf.h5 "
      "-o view.json");
  const StageConfig stage = stage_file();
  const auto details = of_fit(&stage);

  const FrfEstimate frf = read_frf(at("frf.h5"));
  const Eigen::VectorXd fitted_hz = select_band(frf, 120.0, 800.0).frequency_hz;
  const Eigen::MatrixXd variance = read_response_variance(at("covariance.h5"), fitted_hz);
  ASSERT_GT(variance.size(), 0);
  ASSERT_LT(variance.cols(), frf.lines());
  Eigen::MatrixXd deviation = Eigen::MatrixXd::Zero(variance.rows(), frf.lines());
  for (Eigen::Index k = 0, fitted = 0; k < frf.lines(); ++k)
    if (fitted < fitted_hz.size() && frf.frequency_hz[k] == fitted_hz[fitted])
      deviation.col(k) = variance.col(fitted++).cwiseSqrt();
  const report::LogBytes expected = report::encode_log_bytes(deviation);
  EXPECT_EQ(details->deviation.text, expected.text);
  for (std::size_t c = 0; c < expected.low.size(); ++c)
    EXPECT_NEAR(details->deviation.low[c], expected.low[c], 1e-6);

  const Json by_command = margin(test::read_bytes(at("view.json")));
  const Json here = margin(details->loop);
  for (const char* part : {"value", "radius_95"})
    EXPECT_NEAR(here[part].get<double>(), by_command[part].get<double>(),
                1e-6 * by_command[part].get<double>());
  EXPECT_EQ(details->problem, "");
}

TEST_F(FitDetailsTest, AnOpenedModelShowsWhatItsFilesTell) {
  make_model();
  const FrfEstimate frf = read_frf(at("frf.h5"));
  const AdditiveModel model = read_model(at("model.json"));
  const StageConfig stage = stage_file();
  ReportInput input;
  input.model = at("model.json");
  const auto bare = details_of_files(input, model, frf, nullptr);
  EXPECT_EQ(bare->deviation.text + bare->loop, "");
  EXPECT_TRUE(margin(details_of_files(input, model, frf, &stage)->loop)["radius_95"].is_null());
  succeed("export model.json --controller-view small_stage.yaml -o view.json");
  input.controller_view = at("view.json");
  EXPECT_EQ(Json::parse(details_of_files(input, model, frf, nullptr)->loop)["model_fingerprint"],
            fingerprint_of_file(at("model.json")));
}

TEST_F(FitDetailsTest, AControllerThatDoesNotFitIsTold) {
  make_model();
  StageConfig stage = stage_file();
  stage.spec.info.sample_rate_hz *= 2.0;
  const auto details = of_fit(&stage);
  EXPECT_EQ(details->loop, "");
  EXPECT_THAT(details->problem, testing::HasSubstr("small_stage.yaml"));
  EXPECT_NE(details->deviation.text, "");
}

}  // namespace stageid::test_fit_details
