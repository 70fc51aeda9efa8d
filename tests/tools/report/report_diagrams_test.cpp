#include "tools/report/report_diagrams.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace stageid::report {
namespace test_report_diagrams {

using nlohmann::json;

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

}  // namespace test_report_diagrams
}  // namespace stageid::report
