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

/// Without numerators.
Submodel identified(double frequency_hz, double damping = 0.01, std::optional<double> std_hz = {}) {
  Submodel out = mode(frequency_hz, damping, {});
  out.natural_frequency_std_hz = std_hz;
  if (std_hz) out.damping_ratio_std = 0.01 * damping;
  return out;
}

AdditiveModel model_of(std::vector<Submodel> submodels) {
  AdditiveModel model;
  model.submodels = std::move(submodels);
  return model;
}

TrueMode truth(double frequency_hz, double damping = 0.01) {
  return {.natural_frequency_hz = frequency_hz, .damping_ratio = damping};
}

TEST(ModeRows, BothModesOfAClosePairGetTheirPartner) {
  // 200.4 is within the limit of both true modes.
  const auto rows = mode_rows(model_of({identified(200.9), identified(200.4)}),
                              std::vector{truth(201.0), truth(200.0)});
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_NEAR(*rows[0].frequency_hz, 200.4, 1e-9);
  EXPECT_EQ(rows[0].truth->natural_frequency_hz, 200.0);
  EXPECT_NEAR(*rows[1].frequency_hz, 200.9, 1e-9);
  EXPECT_EQ(rows[1].truth->natural_frequency_hz, 201.0);
}

TEST(ModeRows, AMissingModeDoesNotShiftTheOthers) {
  const auto rows = mode_rows(model_of({identified(100.0), identified(201.5), identified(300.0)}),
                              std::vector{truth(100.0), truth(200.0), truth(201.4), truth(300.0)});
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_FALSE(rows[1].frequency_hz);
  EXPECT_EQ(rows[1].truth->natural_frequency_hz, 200.0);
  EXPECT_NEAR(*rows[2].frequency_hz, 201.5, 1e-9);
  EXPECT_EQ(rows[2].truth->natural_frequency_hz, 201.4);
  EXPECT_EQ(rows[3].truth->natural_frequency_hz, 300.0);
}

TEST(ModeRows, AModeFarFromAllHasNoTruth) {
  const auto rows =
      mode_rows(model_of({identified(100.0), identified(150.0)}), std::vector{truth(100.0)});
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_TRUE(rows[0].truth);
  EXPECT_FALSE(rows[1].truth);
  EXPECT_FALSE(rows[1].frequency_deviation());
}

TEST(ModeRows, OnlyModesAreListedByFrequency) {
  Submodel rigid;
  rigid.integrators = 2;
  const auto rows = mode_rows(model_of({identified(300.0), rigid, identified(100.0)}), {});
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_NEAR(*rows[0].frequency_hz, 100.0, 1e-9);
  EXPECT_NEAR(*rows[1].frequency_hz, 300.0, 1e-9);
}

TEST(ModeRows, DeviationsAreSignedAndInStandardDeviations) {
  const auto rows =
      mode_rows(model_of({identified(99.0, 0.0102, 0.5)}), std::vector{truth(100.0, 0.01)});
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_NEAR(*rows[0].frequency_deviation(), -2.0, 1e-9);
  EXPECT_NEAR(*rows[0].damping_deviation(), 0.0002 / 0.000102, 1e-9);
  EXPECT_NEAR(*rows[0].relative_frequency_error(), 0.01, 1e-9);
}

TEST(ModeRows, WithoutStandardDeviationNothingIsInStandardDeviations) {
  const auto rows = mode_rows(model_of({identified(99.0)}), std::vector{truth(100.0)});
  EXPECT_FALSE(rows[0].frequency_deviation());
  EXPECT_FALSE(rows[0].damping_deviation());
}

}  // namespace stageid::test_truth_comparison
