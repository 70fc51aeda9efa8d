// The loop of an identified model with the controller of its stage, with the real program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "hal/simulator/loop_stability.hpp"
#include "hal/simulator/plant_spec.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tests/tools/config/controller_arrays.hpp"
#include "tests/tools/program_fixture.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid::test {
namespace test_controller_view {

using nlohmann::json;
using testing::HasSubstr;

struct ControllerViewTest : ProgramTest {
  void make_model_with_covariance() const {
    make_frf();
    succeed(
        "fit frf.h5 -o model.json --covariance covariance.h5 --rigid-body suspension:0.4:0.5 "
        "--direct-term full");
  }
  /// A variant of the stage file.
  std::string variant(const std::string& file, const std::string& from,
                      const std::string& to) const {
    write_bytes(at(file), replaced(read_bytes(at("small_stage.yaml")), from, to));
    return file;
  }
  json view(const std::string& more = "",
            const std::string& stage_file = "small_stage.yaml") const {
    succeed("export model.json -o view.json --controller-view " + stage_file + " " + more);
    return json::parse(read_bytes(at("view.json")));
  }
};

TEST_F(ControllerViewTest, CurvesAndSensitivityAreThoseOfTheSimulatedLoop) {
  make_model_with_covariance();
  const json told = view("--covariance covariance.h5 --frf frf.h5");
  EXPECT_EQ(told["format"], "stageid-controller-view");
  EXPECT_TRUE(told["stable"]);
  EXPECT_EQ(told["encirclements"], 0);
  ASSERT_EQ(told["loops"].size(), 2U);
  EXPECT_EQ(told["loops"][0]["name"], "z");
  EXPECT_EQ(told["loops"][1]["name"], "Ry");

  const StageConfig stage = load_stage_config(at("small_stage.yaml"));
  const std::vector<PlantMode> modes = plant_modes(stage.spec.info, *stage.plant);
  const MotionController controller(stage.spec.controller);
  int inside = 0;
  const std::size_t lines = told["frequency_hz"].size();
  ASSERT_EQ(lines, 197U);
  for (std::size_t k = 0; k < lines; ++k) {
    const double f = told["frequency_hz"][k];
    const Eigen::MatrixXcd G =
        sampled_response(modes, stage.spec.info.delay_s, stage.spec.info.sample_rate_hz, f);
    const Eigen::MatrixXcd L = -G * controller.response(f);
    const std::complex<double> exact = (1.0 + L(0, 0)) * (1.0 + L(1, 1)) - L(0, 1) * L(1, 0);
    const json& d = told["determinant"];
    const std::complex<double> value(d["re"][k], d["im"][k]);
    EXPECT_LT(std::abs(value - exact), 1e-3 * std::abs(exact)) << f;
    inside += std::abs(value - exact) <= d["radius_95"][k].get<double>() ? 1 : 0;
  }
  // Neighbours depend on each other, so a few parameters decide; far from the line only a wrong radius is.
  EXPECT_GT(inside, 98);

  EXPECT_LT(told["largest_pole"], 1.0);
  for (const json& loop : told["loops"]) {
    const json& modulus = loop["modulus_margin"];
    EXPECT_GT(modulus["value"], 0.4);
    EXPECT_GT(modulus["radius_95"], 0.0);
    EXPECT_LT(modulus["radius_95"], 1e-3);
    EXPECT_GT(loop["gain_margin_db"]["value"], 6.0);
    EXPECT_TRUE(loop["gain_reduction_db"]["extrapolated"]);
    EXPECT_NEAR(loop["phase_margin_deg"]["value"], 40.0, 3.0);
    EXPECT_NEAR(loop["phase_margin_deg"]["frequency_hz"], 20.0, 0.5);  // crossover_hz
  }
}

TEST_F(ControllerViewTest, TheSimulatedStageBecomesUnstableAtTheGainMargin) {
  make_model_with_covariance();
  const json told = view("--covariance covariance.h5");
  const StageConfig stage = load_stage_config(at("small_stage.yaml"));
  const std::size_t axes[] = {2, 4};  // z and Ry of x, y, z, Rx, Ry, Rz
  for (std::size_t k = 0; k < 2; ++k) {
    const json& margin = told["loops"][k]["gain_margin_db"];
    const double db = margin["value"];
    EXPECT_LT(margin["radius_95"], 0.005);
    const auto stable_at = [&](double gain_db) {
      StageSpec changed = stage.spec;
      changed.controller.axes[axes[k]].gain *= std::pow(10.0, gain_db / 20.0);
      return loop_stability(changed, *stage.plant).stable();
    };
    EXPECT_TRUE(stable_at(db - 0.01)) << told["loops"][k]["name"];
    EXPECT_FALSE(stable_at(db + 0.01)) << told["loops"][k]["name"];
  }
}

TEST_F(ControllerViewTest, ATableHasOneRowPerLine) {
  make_model_with_covariance();
  const std::string told =
      succeed("export model.json -o view.csv --controller-view small_stage.yaml --frf frf.h5").out;
  EXPECT_THAT(told, HasSubstr("loop z: gain margin"));
  EXPECT_THAT(told, HasSubstr("closed loop: stable"));
  std::istringstream table(read_bytes(at("view.csv")));
  std::string line;
  std::getline(table, line);
  EXPECT_EQ(line,
            "frequency_hz,real z,imaginary z,radius_95 z,real Ry,imaginary Ry,radius_95 Ry,real "
            "det(I + L),imaginary det(I + L),radius_95 det(I + L)");
  int rows = 0;
  for (; std::getline(table, line); ++rows) EXPECT_EQ(std::ranges::count(line, ','), 9);
  EXPECT_EQ(rows, 197);
}

TEST_F(ControllerViewTest, MatricesAreOneLoopPerActuatorOfTheSameDeterminant) {
  make_model_with_covariance();
  const json axes = view("--frf frf.h5");
  const MotionController controller(load_stage_config(at("small_stage.yaml")).spec.controller);
  write_npz(at("c.npz"), arrays_of(at("c.npz"), controller.realization()));
  const std::string text = read_bytes(at("small_stage.yaml"));
  write_bytes(at("matrices.yaml"),
              text.substr(0, text.find("controller:")) + "controller: c.npz\n");
  const json matrices = view("--frf frf.h5", "matrices.yaml");
  ASSERT_EQ(matrices["loops"].size(), 3U);
  EXPECT_EQ(matrices["loops"][2]["name"], "a3");
  EXPECT_NEAR(matrices["largest_pole"], axes["largest_pole"], 1e-9);
  for (std::size_t k = 0; k < axes["frequency_hz"].size(); ++k)
    EXPECT_NEAR(matrices["determinant"]["re"][k], axes["determinant"]["re"][k], 1e-7);
}

TEST_F(ControllerViewTest, AnUnstableLoopIsToldAndHasNoMargins) {
  make_model_with_covariance();
  const std::string fast = variant("fast.yaml", "crossover_hz: 20", "crossover_hz: 150");
  const json told = tell("export model.json -o view.json --controller-view " + fast, 3);
  EXPECT_FALSE(told["stable"]);
  EXPECT_GT(told["encirclements"], 0);
  EXPECT_FALSE(told["loops"][0].contains("gain_margin_db"));
  EXPECT_TRUE(told["determinant"]["distance"].is_null());
}

TEST_F(ControllerViewTest, TheReportShowsTheViewOfItsModelOnly) {
  make_model_with_covariance();
  view();
  succeed("report frf.h5 model.json view.json -o report.html");
  EXPECT_THAT(read_bytes(at("report.html")), HasSubstr("\"encirclements\":0"));
  succeed("fit frf.h5 -o model.json --rigid-body suspension --direct-term full");
  fail("report frf.h5 model.json view.json -o new.html", 2,
       "view.json:/model_fingerprint: is that of another model than model.json");
}

TEST_F(ControllerViewTest, WhatDoesNotBelongTogetherIsRefused) {
  make_model_with_covariance();
  const auto refuse = [&](const std::string& more, const std::string& text) {
    fail("export model.json -o view.json " + more, 2, text);
  };
  refuse("--controller-view small_stage.yaml --driving-point s1 a1", "--driving-point");
  refuse("--controller-view " + variant("name.yaml", "name: s2", "name: s9"),
         "the loop of z uses sensor 's9'");
  const std::string text = read_bytes(at("small_stage.yaml"));
  write_bytes(at("open.yaml"), text.substr(0, text.find("controller:")) +
                                   "controller: {state_space: {d: [0, 0, 0, 0, 0, 0]}}\n");
  refuse("--controller-view open.yaml", "closes no loop");
  run("fit frf.h5 -o other.json --modes 3");
  fail(
      "export other.json -o view.json --controller-view small_stage.yaml --covariance "
      "covariance.h5",
      2, "covariance.h5:/parameters/value: differs from the model");
}

}  // namespace test_controller_view
}  // namespace stageid::test
