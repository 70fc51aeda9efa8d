#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/request/fit_request.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/stages/varied_plant.hpp"

// Plants of random structure, fitted without any option and with one that is wrong.

namespace stageid::test_structure_search {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// Fitted from the true structure and the true parameters.
double cost_of_truth(const test::VariedPlant& plant) {
  FitOptions options = make_fit_setup({}, plant.frf).options;
  options.delay = plant.delay;
  options.delay_s = plant.truth.mean_delay_s();
  options.uncertainty = false;
  return fit_additive_model(plant.frf, plant.truth, options).model.fit.cost;
}

class StructureSearch : public testing::TestWithParam<std::uint64_t> {};

TEST_P(StructureSearch, FindsTheStructureOfAPlant) {
  const test::VariedPlant plant = test::draw_varied_plant(GetParam());
  const FitResult fit = fit_model(plant.frf);
  EXPECT_TRUE(fit.trustworthy()) << plant.description() << ": " << fit.message();
  EXPECT_NEAR(fit.model.fit.cost / cost_of_truth(plant), 1.0, 0.01) << plant.description();
  EXPECT_EQ(fit.model.submodels.size(), plant.truth.submodels.size()) << plant.description();
  EXPECT_EQ(fit.delay, plant.delay);
}

// Of the first forty, those that are fitted within seconds. They cover a missing, a free and a suspended body, both
// dampings, direct terms, and delays per channel. In 1001, springs describe the delays until these are found. In 68024,
// the lines on which the search begins do not show the direct term.
INSTANTIATE_TEST_SUITE_P(Plants, StructureSearch,
                         testing::Values(3, 5, 10, 11, 12, 18, 33, 35, 1001, 68024));

// A strong mode above the lines and inputs that are late by different parts of a sample: general damping with one delay
// for all describes the data as well, with three times as many parameters and wrong delays.
TEST(StructureSearchFixed, DelaysAndAModeAboveTheLinesAreNotTakenForGeneralDamping) {
  constexpr double kPeriod_s = 250e-6;
  const Eigen::Vector3d late_s = Eigen::Vector3d(1.25, 0.1, 1.94) * kPeriod_s;
  test::RandomNumbers random(1);
  AdditiveModel truth;
  truth.hold = HoldModel::exact;
  truth.sample_rate_hz = 1.0 / kPeriod_s;
  truth.outputs = {{"y1", "y2", "y3", "y4"}, {"m", "m", "m", "m"}};
  truth.inputs = {{"u1", "u2", "u3"}, {"N", "N", "N"}};
  truth.input_delay_s = late_s;
  truth.output_delay_s = Eigen::Vector4d::Zero();
  const double modes[][3] = {
      {25.4, 0.037, 1}, {91.6, 0.06, 1}, {132.7, 0.011, 1}, {1090, 0.077, 10}};
  for (const auto& [frequency_hz, damping, gain] : modes) {
    const Eigen::MatrixXd shape = gain * test::random_matrix(random, 4, 1);
    const std::vector<double> a = test::mode_coefficients(frequency_hz, damping);
    truth.submodels.push_back(
        {0, {1.0, a[0], a[1]}, {shape * test::random_matrix(random, 1, 3)}, {}, {}});
  }
  FrfEstimate frf;
  frf.inputs = truth.inputs;
  frf.outputs = truth.outputs;
  frf.sample_rate_hz = truth.sample_rate_hz;
  frf.hold = Hold::zoh;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(600, 4.0, 800.0);
  frf.response = test::reference_response(truth, frf.frequency_hz, HoldModel::exact);
  frf.noise_variance =
      (1e-4 * frf.response.cwiseAbs().rowwise().mean()).array().square().matrix().replicate(1, 600);
  test::add_noise(frf, random);

  const FitResult fit = fit_model(frf);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_EQ(fit.delay, DelayModel::per_channel);
  EXPECT_FALSE(structure_of(fit.model).general_damping);
  ASSERT_EQ(fit.model.input_delay_s.size(), 3);
  const double output_s = fit.model.output_delay_s.mean();
  for (Eigen::Index u = 0; u < 3; ++u)
    EXPECT_NEAR(fit.model.input_delay_s[u] + output_s, late_s[u], 0.1e-6) << u;
}

TEST(StructureSearchFixed, WhatIsRequestedIsNotChanged) {
  const test::VariedPlant plant = test::draw_varied_plant(5);  // free body, general damping
  FitRequest request;
  request.search_seconds = 1.0;
  request.general_damping = false;
  request.direct_term = false;
  request.rigid_body.kind = RigidBodyRequest::Kind::free;
  request.delay = DelayRequest{DelayModel::estimate};
  const FitResult fit = fit_model(plant.frf, request);
  const ModelStructure found = structure_of(fit.model);
  EXPECT_FALSE(found.general_damping);
  EXPECT_FALSE(found.direct_term);
  EXPECT_TRUE(found.rigid_body);
  EXPECT_EQ(fit.delay, DelayModel::estimate);
  EXPECT_THAT(fit.decisions, Not(Contains(HasSubstr("structure: "))));
  EXPECT_FALSE(fit.trustworthy());
  EXPECT_THAT(fit.message(), HasSubstr("--damping general"));
}

// A free body with general damping; a suspended one with a mode of rank two; one with both; two whose suspension is first
// taken for one of the modes.
TEST(StructureSearchFixed, ANumberOfModesLeavesTheStructureOpen) {
  for (const std::uint64_t seed : {5U, 1U, 15U, 18U, 5012U}) {
    const test::VariedPlant plant = test::draw_varied_plant(seed);
    FitRequest request;
    request.modes.kind = ModesRequest::Kind::count;
    request.modes.count = plant.modes();
    const FitResult fit = fit_model(plant.frf, request);
    EXPECT_TRUE(fit.trustworthy()) << seed << ": " << fit.message();
    EXPECT_EQ(count_modes(fit.model), plant.modes()) << seed;
    EXPECT_NEAR(fit.model.fit.cost / cost_of_truth(plant), 1.0, 0.01) << seed;
  }
}

TEST(StructureSearchFixed, GivenModesLeaveNothingOpen) {
  const test::VariedPlant plant = test::draw_varied_plant(5);
  FitRequest request;
  request.modes.kind = ModesRequest::Kind::given;
  for (const Submodel& s : plant.truth.submodels)
    if (is_searched_mode(s))
      request.modes.given.push_back({s.natural_frequency_hz(), s.damping_ratio(), 1});
  const FitResult fit = fit_model(plant.frf, request);
  EXPECT_THAT(fit.decisions, Not(Contains(HasSubstr("structure: "))));
  EXPECT_EQ(count_modes(fit.model), count_modes(plant.truth));
  EXPECT_FALSE(fit.trustworthy());
  EXPECT_THAT(fit.message(), HasSubstr("--damping general"));
}

/// A body on two soft springs far below the lines, and two modes: 2 x 2, white noise of known variance.
FrfEstimate on_soft_springs(std::uint64_t seed, double damping_of_springs) {
  test::RandomNumbers random(seed);
  test::DenseProblem problem;
  problem.model = test::named_model(2, 2);
  problem.model.sample_rate_hz = 2000.0;
  problem.model.input_delay_s.setConstant(5e-4);
  problem.hold = HoldModel::exact;
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(784, 16.0, 799.0);
  const auto add = [&](double f, double damping, const Eigen::Matrix2d& residue) {
    problem.model.submodels.push_back(test::empty_mode(problem.model, f, damping));
    Submodel& s = problem.model.submodels.back();
    s.numerator[0] = s.denominator[2] * residue;
  };
  const Eigen::Vector2d heave(1.0, 1.0), pitch(1.0, -1.0);
  add(2.0, damping_of_springs, heave * heave.transpose() / 8.0);
  add(2.5, damping_of_springs, pitch * pitch.transpose() / 8.0);
  add(92.0, 0.006, 0.09 * Eigen::Vector2d(1.0, 0.5) * Eigen::RowVector2d(1.0, 0.6));
  add(310.0, 0.01, 0.09 * Eigen::Vector2d(0.9, -1.0) * Eigen::RowVector2d(1.0, -0.8));
  test::measure(problem);
  FrfEstimate frf = test::frf_of(problem);
  frf.noise_variance.setConstant(4, frf.lines(), 1e-18);
  for (std::complex<double>& value : frf.response.reshaped()) value += 1e-9 * random.circular();
  return frf;
}

TEST(StructureSearchFixed, PolesFarBelowTheLinesAreHeldWhereTheDataLeaveThemOpen) {
  int sound = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const FitResult fit = fit_model(on_soft_springs(seed, seed % 2 == 0 ? 0.5 : 0.1));
    if (!fit.trustworthy()) continue;
    ++sound;
    for (const double f : {92.0, 310.0})
      EXPECT_TRUE(std::any_of(fit.model.submodels.begin(), fit.model.submodels.end(),
                              [f](const Submodel& s) {
                                return s.natural_frequency_std_hz &&
                                       std::abs(s.natural_frequency_hz() - f) <
                                           5.0 * *s.natural_frequency_std_hz;
                              }))
          << f << ", seed " << seed;
  }
  EXPECT_GE(sound, 4);
}

}  // namespace stageid::test_structure_search
