#include "tools/steps/truth_comparison.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <optional>

#include "estimation/modal/validation.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_truth_comparison {

using Partners = std::vector<std::optional<std::size_t>>;

Submodel mode(double frequency_hz, double damping, const Eigen::MatrixXd& B0) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  Submodel s;
  s.denominator = {1.0, 2.0 * damping / omega, 1.0 / (omega * omega)};
  s.numerator = {B0 / (omega * omega)};
  return s;
}

/// The small stage of two actuators and one sensor as a model: every mode in its own submodel.
AdditiveModel exact_model(const test::SimulatedSpec& stage) {
  AdditiveModel model;
  model.inputs = {{"a1", "a2"}, {"N", "N"}};
  model.outputs = {{"s1"}, {"m"}};
  model.sample_rate_hz = stage.info.sample_rate_hz;
  model.hold = HoldModel::exact;
  model.input_delay_s = Eigen::VectorXd::Constant(2, stage.info.delay_s);
  model.output_delay_s = Eigen::VectorXd::Zero(1);
  for (const PlantMode& m : plant_modes(stage.info, stage.plant))
    model.submodels.push_back(mode(m.natural_frequency_hz, m.damping_ratio,
                                   m.sensor_shape * m.actuator_shape.transpose()));
  return model;
}

FrfEstimate lines(const AdditiveModel& model) {
  FrfEstimate frf;
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(100, 4.0, 400.0);
  frf.response = Eigen::MatrixXcd::Ones(2, 100);
  frf.sample_rate_hz = model.sample_rate_hz;
  frf.hold = Hold::zoh;
  return frf;
}

test::SimulatedSpec small_stage() {
  test::SimulatedSpec stage = test::small_stage_spec();
  stage.info.delay_s = 0.4e-3;
  return stage;
}

TEST(TruthComparison, TheExactModelHasNoError) {
  const test::SimulatedSpec stage = small_stage();
  const AdditiveModel model = exact_model(stage);
  const TruthComparison truth = compare_with_truth(model, lines(model), stage.info, stage.plant);
  // hal and estimation share no code: two independent computations of the same numbers, through sampled responses
  // whose closed forms cancel by (f / f_mode)^2 at most, 400^2 here.
  EXPECT_LT(truth.relative_rms_error, 1e-9);
  EXPECT_LT(truth.normalized_error, 1e-9);
  ASSERT_EQ(truth.modes.size(), 1U);
  EXPECT_TRUE(truth.modes[0].frequency_hz);
  EXPECT_NEAR(*truth.modes[0].frequency_hz, 80.0, 1e-9);
}

TEST(TruthComparison, CountsDeviationsInStandardDeviations) {
  const test::SimulatedSpec stage = small_stage();
  AdditiveModel model = exact_model(stage);
  Submodel& flexible = model.submodels.at(6);
  flexible = mode(80.4, 0.019, flexible.numerator[0]);
  flexible.natural_frequency_std_hz = 0.2;
  flexible.damping_ratio_std = 0.0005;
  const TruthComparison truth = compare_with_truth(model, lines(model), stage.info, stage.plant);
  EXPECT_NEAR(*truth.modes.at(0).frequency_deviation(), 2.0, 1e-9);
  EXPECT_NEAR(*truth.modes.at(0).damping_deviation(), -2.0, 1e-9);
  EXPECT_NEAR(*truth.modes.at(0).relative_frequency_error(), 0.005, 1e-9);
  EXPECT_GT(truth.relative_rms_error, 1e-3);
}

// An actuator that moves nothing: the exact response is zero, the measured one noise.
TEST(TruthComparison, WhatIsDecoupledDoesNotDecideTheRelativeError) {
  test::SimulatedSpec stage = small_stage();
  stage.info.actuators[1].direction[2] = 0.0;
  stage.info.actuators[1].direction[0] = 1.0;
  const AdditiveModel exact = exact_model(stage);
  FrfEstimate frf = lines(exact);
  frf.response = response_like(exact, frf);
  frf.noise_variance = Eigen::MatrixXd::Constant(2, frf.lines(), 1e-30);
  frf.noise_dof = 10.0;
  frf.response.row(1).setConstant(1e-15);
  AdditiveModel model = exact;
  for (Submodel& s : model.submodels) s.numerator[0] *= 1.01;
  const TruthComparison truth = compare_with_truth(model, frf, stage.info, stage.plant);
  EXPECT_NEAR(truth.relative_rms_error, 0.01, 1e-6);
  EXPECT_TRUE(truth_json(truth)["relative_rms_error"].is_number());
}

TEST(TruthComparison, MatchesOneToOneAndNamesTheRest) {
  const test::SimulatedSpec stage = small_stage();
  AdditiveModel model = exact_model(stage);
  model.submodels.erase(model.submodels.begin(), model.submodels.begin() + 6);
  model.submodels.push_back(mode(81.0, 0.02, model.submodels[0].numerator[0]));
  model.submodels.push_back(mode(200.0, 0.02, model.submodels[0].numerator[0]));
  const TruthComparison truth = compare_with_truth(model, lines(model), stage.info, stage.plant);
  EXPECT_NEAR(*truth.modes.at(0).frequency_hz, 80.0, 1e-9);
  ASSERT_EQ(truth.extra_hz.size(), 2U);
  EXPECT_NEAR(truth.extra_hz[0], 81.0, 1e-9);
  const std::vector<std::string> table = truth_table(truth);
  EXPECT_NE(table.back().find("200.0000 Hz"), std::string::npos);
}

// In order of frequency, 100.9 would belong to 100.
TEST(TruthComparison, TheNearestModesArePairedFirst) {
  EXPECT_EQ(pair_with_truth({100.0, 101.0}, {100.9, 103.0}), (Partners{1, 0}));
  EXPECT_EQ(pair_with_truth({100.0}, {101.0, 100.9}), Partners{1});
}

TEST(TruthComparison, ModesThatDifferByFivePercentAreNotPaired) {
  EXPECT_EQ(pair_with_truth({100.0, 200.0}, {104.9, 210.1}), (Partners{0, std::nullopt}));
  EXPECT_EQ(pair_with_truth({100.0}, {}), Partners{std::nullopt});
  EXPECT_EQ(pair_with_truth({}, {100.0}), Partners{});
}

TEST(TruthComparison, AModeThatIsMissingIsSaid) {
  const test::SimulatedSpec stage = small_stage();
  AdditiveModel model = exact_model(stage);
  model.submodels.resize(6);
  const TruthComparison truth = compare_with_truth(model, lines(model), stage.info, stage.plant);
  EXPECT_FALSE(truth.modes.at(0).frequency_hz);
  EXPECT_NE(truth_table(truth).at(1).find("not found"), std::string::npos);
  EXPECT_FALSE(truth_json(truth)["modes"][0]["found"].get<bool>());
}

AdditiveModel model_of(std::vector<Submodel> submodels) {
  AdditiveModel model;
  model.submodels = std::move(submodels);
  return model;
}

TEST(ModeRows, OnlyModesAreListedByFrequency) {
  Submodel rigid;
  rigid.integrators = 2;
  const auto rows = mode_rows(model_of({mode(300.0, 0.01, {}), rigid, mode(100.0, 0.01, {})}), {});
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_NEAR(*rows[0].frequency_hz, 100.0, 1e-9);
  EXPECT_NEAR(*rows[1].frequency_hz, 300.0, 1e-9);
}

TEST(ModeRows, WithoutStandardDeviationNothingIsInStandardDeviations) {
  const auto rows =
      mode_rows(model_of({mode(99.0, 0.01, {})}),
                std::vector{TrueMode{.natural_frequency_hz = 100.0, .damping_ratio = 0.01}});
  EXPECT_TRUE(rows[0].truth);
  EXPECT_FALSE(rows[0].frequency_deviation());
  EXPECT_FALSE(rows[0].damping_deviation());
}

}  // namespace stageid::test_truth_comparison
