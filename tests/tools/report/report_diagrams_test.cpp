#include "tools/report/report_diagrams.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/input_files.hpp"
#include "tests/tools/report/synthetic_report.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid::report {
namespace test_report_diagrams {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(ReportDiagrams, KeepPolesToATenthOfAMillihertz) {
  const json got = stabilization_json(
      {{.order = 2, .frequency_hz = 123.456789, .damping_ratio = 0.00123456},
       {.order = 4, .frequency_hz = 5.0, .damping_ratio = 0.1, .stable_frequency = true},
       {.order = 6,
        .frequency_hz = 5.0,
        .damping_ratio = 0.1,
        .stable_frequency = true,
        .stable_damping = true}});
  EXPECT_EQ(got, json::parse("[[2,123.4568,0.001235,0],[4,5.0,0.1,1],[6,5.0,0.1,2]]"));
}

TEST(ReportDiagrams, KeepFourDigitsOfATestHoweverSmallItsChance) {
  const double tiny = std::numeric_limits<double>::denorm_min();
  NonlinearityTest test;
  test.band_hz = Eigen::MatrixXd{{1.0, 2.5}};
  test.p_value = Eigen::MatrixXd{{1.23456e-300}, {tiny}, {0.0}};
  test.distortion = Eigen::MatrixXd{{0.0123456}, {1.0}, {0.0}};
  const json got = nonlinearity_json(test);
  EXPECT_EQ(got["bands"], json::parse("[[1.0,2.5]]"));
  EXPECT_NEAR(got["p_value"][0][0].get<double>() / 1.235e-300, 1.0, 1e-6);
  EXPECT_EQ(got["p_value"][1][0].get<double>(), tiny);
  EXPECT_EQ(got["p_value"][2][0].get<double>(), 0.0);
  EXPECT_NEAR(got["distortion"][0][0].get<double>(), 0.01235, 1e-12);
  EXPECT_EQ(got["settled"], json::parse("[true]"));
  test.settled_p_value = Eigen::VectorXd::Constant(1, 1e-3);
  EXPECT_EQ(nonlinearity_json(test)["settled"], json::parse("[false]"));
}

TEST(StageInfoOfAFile, IsWhatTheStageFileSays) {
  const std::string file = STAGEID_SOURCE_DIR "/configs/stage/wafer_stage.yaml";
  const StageInfo geometry = stage_info(file, read_whole_file(file));
  EXPECT_EQ(geometry.name, "wafer stage");
  ASSERT_EQ(geometry.actuators.size(), 17u);
  ASSERT_EQ(geometry.sensors.size(), 7u);
  EXPECT_EQ(geometry.actuators[2].name, "z3");
  EXPECT_THAT(geometry.actuators[2].position_m, ElementsAre(0.26, -0.21, 0.0));
  EXPECT_THAT(geometry.actuators[13].direction, ElementsAre(1.0, 0.0, 0.0));
  EXPECT_THAT(geometry.sensors[0].position_m, ElementsAre(-0.255, -0.258, 0.0));
}

TEST(StageInfoOfAFile, RefusesWhatIsNoStageFile) {
  for (const char* text : {"", "[1, 2", "format: stageid-experiment\n", "format: stageid-stage\n",
                           "format: stageid-stage\nactuators: 3\n"}) {
    EXPECT_THAT([&] { stage_info("a.yaml", text); },
                testing::ThrowsMessage<FormatError>(HasSubstr("a.yaml")))
        << text;
  }
}

TEST(ReportShapes, FindPlacesByName) {
  StageInfo geometry;
  geometry.sensors = {{"b", "m", {1.0, 2.0, 3.0}, {0.0, 1.0, 0.0}}};
  const ChannelList outputs{.names = {"a", "b"}, .units = {"m", "m"}};
  const ChannelList inputs{.names = {"u"}, .units = {"N"}};
  const json got = geometry_json(geometry, outputs, inputs);
  EXPECT_TRUE(got["outputs"][0].is_null());
  EXPECT_EQ(got["outputs"][1]["position_m"], json({1.0, 2.0, 3.0}));
  EXPECT_EQ(got["outputs"][1]["direction"], json({0.0, 1.0, 0.0}));
  EXPECT_TRUE(got["inputs"][0].is_null());
  EXPECT_TRUE(geometry_json(geometry, inputs, inputs).is_null());
}

TEST(ReportShapes, ComeByFrequencyHoweverTheModelOrdersThem) {
  ReportData data = test::synthetic_report({.outputs = 2, .inputs = 3, .lines = 10, .modes = 4});
  const json rising = shapes_json(*data.model);
  std::ranges::reverse(data.model->submodels);
  EXPECT_EQ(shapes_json(*data.model), rising);
  for (std::size_t i = 1; i < 4; ++i)
    EXPECT_LT(rising["modes"][i - 1]["frequency_hz"].get<double>(),
              rising["modes"][i]["frequency_hz"].get<double>());
}

TEST(ReportShapes, RoundAndLeaveOutWhatIsNoNumber) {
  const Eigen::MatrixXd matrix{{0.123456, -2.0}, {std::numeric_limits<double>::quiet_NaN(), 1e-9}};
  const json got = matrix_json(matrix, rounded_mac);
  EXPECT_EQ(got, json({{0.1235, -2.0}, {nullptr, 0.0}}));
}

}  // namespace test_report_diagrams
}  // namespace stageid::report
