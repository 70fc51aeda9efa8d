// Residues of given rank: the derivatives of the factors compared with finite differences, exact data, effect of noise
// and of a wrong rank on the cost.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "estimation/equations/residue_form.hpp"
#include "estimation/fit/fit_additive_model.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "tests/estimation/submodel_cases.hpp"
#include "tests/support/models/expect_same_fit.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test_low_rank {

using testing::Contains;
using testing::HasSubstr;

Eigen::VectorXd mode_a(double frequency_hz, double damping) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  return Eigen::Vector2d(2.0 * damping / omega, 1.0 / (omega * omega));
}

/// Every derivative that the form gives, against central differences of its numerators.
void expect_derivatives(const SubmodelShape& shape, int rank) {
  test::RandomNumbers random(3);
  constexpr Eigen::Index kOutputs = 3;
  constexpr Eigen::Index kInputs = 4;
  ResidueForm form(shape, rank, kOutputs, kInputs);
  const Eigen::VectorXd a = shape.order == 2 ? mode_a(130.0, 0.1) : Eigen::VectorXd();
  form.project(a, random_matrix(random, kOutputs * kInputs, shape.functions()),
               Eigen::MatrixXd::Ones(kOutputs, kInputs));
  // d B / d parameter, by the form; parameter -1, -2 behind the others.
  const Eigen::Index size = form.size();
  const Eigen::Index values = kOutputs * kInputs * shape.functions();
  Eigen::MatrixXd given = Eigen::MatrixXd::Zero(values, size + 2);
  std::vector<ResidueForm::Derivative> entries;
  for (Eigen::Index c = 0; c < kOutputs * kInputs; ++c) {
    form.derivatives(a, c, entries);
    for (const auto& [function, parameter, value] : entries)
      given(c + kOutputs * kInputs * function, parameter >= 0 ? parameter : size - 1 - parameter) +=
          value;
  }
  const auto check = [&](Eigen::Index column, double h, const Eigen::VectorXd& difference) {
    const double tolerance = 1e-7 * (1.0 + difference.cwiseAbs().maxCoeff());
    EXPECT_LT((given.col(column) - difference).cwiseAbs().maxCoeff(), tolerance)
        << "parameter " << column << " of " << size << ", step " << h;
  };
  for (Eigen::Index p = 0; p < size; ++p) {
    const double h = 1e-5;
    ResidueForm up = form;
    ResidueForm down = form;
    up.step(h * Eigen::VectorXd::Unit(size, p));
    down.step(-h * Eigen::VectorXd::Unit(size, p));
    check(p, h, ((up.numerators(a) - down.numerators(a)) / (2.0 * h)).reshaped());
  }
  for (Eigen::Index q = 0; q < a.size(); ++q) {
    const double h = 1e-5 * a[q];
    const Eigen::VectorXd step = h * Eigen::VectorXd::Unit(2, q);
    check(size + q, h,
          ((form.numerators(a + step) - form.numerators(a - step)) / (2.0 * h)).reshaped());
  }
}

TEST(ResidueForm, HasTheDerivativesOfDifferences) {
  expect_derivatives({0, 2, 1}, 0);  // free numerators
  expect_derivatives({0, 2, 0}, 1);
  expect_derivatives({2, 0, 0}, 2);  // a rigid body
  expect_derivatives({0, 2, 1}, 1);  // a complex mode
}

TEST(ResidueForm, CountsItsParametersAndRefusesARankThatHasNoForm) {
  EXPECT_EQ(ResidueForm({0, 2, 0}, 1, 4, 13).size(), 4 + 13 - 1);
  EXPECT_EQ(ResidueForm({2, 0, 0}, 3, 4, 13).size(), 3 * (4 + 13 - 3));
  EXPECT_EQ(ResidueForm({0, 2, 1}, 1, 4, 13).size(), 2 * (4 + 13 - 1));
  EXPECT_EQ(ResidueForm({0, 2, 0}, 4, 4, 13).size(), 4 * 13) << "no constraint";
  EXPECT_THROW(ResidueForm({0, 2, 1}, 2, 4, 13), std::invalid_argument);
  EXPECT_THROW(ResidueForm({0, 4, 2}, 1, 4, 13), std::invalid_argument);
}

TEST(ResidueForm, ProjectsByTheWeights) {
  // One entry is wrong and has almost no weight: the projection is the matrix without the error.
  const Eigen::VectorXd phi{{1.0, -2.0, 0.5}};
  const Eigen::VectorXd psi{{2.0, 1.0, -1.0, 3.0}};
  const Eigen::MatrixXd truth = phi * psi.transpose();
  Eigen::MatrixXd B = truth;
  B(1, 2) += 5.0;
  Eigen::MatrixXd weight = Eigen::MatrixXd::Ones(3, 4);
  weight(1, 2) = 1e-12;
  ResidueForm form({0, 2, 0}, 1, 3, 4);
  form.project(mode_a(100.0, 0.01), B.reshaped(12, 1), weight);
  EXPECT_LT((form.numerators(mode_a(100.0, 0.01)).reshaped(3, 4) - truth).norm(), 1e-6);
}

double second_singular_value(const Eigen::MatrixXd& B, Eigen::Index rank) {
  const Eigen::VectorXd values = svd(B, 0).singularValues();
  return values[rank] / values[0];
}

struct LowRankFit : testing::Test {
  LowRankFit() {
    test::RandomStageSpec spec;
    spec.least_modes = spec.most_modes = 7;
    spec.line_spacing_hz = 1.0;
    stage_ = test::draw_random_stage(11, spec);
    options_.weighting = Weighting::noise_variance;
    options_.hold = HoldModel::exact;
    options_.delay_s = stage_.delay_s;
  }
  double error_to_truth(const FitResult& fit) const {
    return (response(fit.model, stage_.frf.frequency_hz, HoldModel::exact) - stage_.exact).norm();
  }

  test::RandomStage stage_;
  FitOptions options_;
};

TEST_F(LowRankFit, ComesCloserToTheTruthAndSaysThatNoiseExplainsTheRest) {
  const FitResult free = fit_additive_model(stage_.frf, stage_.truth, options_);
  options_.residue_rank = 1;
  options_.rigid_body_rank = 3;
  const FitResult fit = fit_additive_model(stage_.frf, stage_.truth, options_);
  ASSERT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_LT(second_singular_value(fit.model.submodels[0].numerator[0], 3), 1e-12);
  EXPECT_EQ(fit.model.submodels[0].residue_rank, 3);
  EXPECT_EQ(fit.model.submodels[1].residue_rank, 1);
  EXPECT_EQ(free.model.submodels[1].residue_rank, std::nullopt);
  for (const Submodel& s : fit.model.submodels)
    if (s.is_mode()) {
      EXPECT_LT(second_singular_value(s.numerator[0], 1), 1e-12);
    }
  EXPECT_LT(error_to_truth(fit), error_to_truth(free));
  EXPECT_GT(fit.model.fit.cost, free.model.fit.cost);
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("consistent with noise")));
  // 7 modes: the mean square of their normalized errors is chi-square of 7 over 7, 0.18 to 2.9 in
  // 99 of 100 cases.
  double sum = 0.0;
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i) {
    const Submodel& s = fit.model.submodels[i];
    if (!s.is_mode()) continue;
    ASSERT_TRUE(s.natural_frequency_std_hz);
    sum += std::pow((s.natural_frequency_hz() - stage_.truth.submodels[i].natural_frequency_hz()) /
                        *s.natural_frequency_std_hz,
                    2);
  }
  EXPECT_GT(sum / 7.0, 0.14);
  EXPECT_LT(sum / 7.0, 2.9);
  // And so is that of the response, over lines and channels.
  const Eigen::MatrixXcd P = response(fit.model, stage_.frf.frequency_hz, HoldModel::exact);
  const double ratio = (P - stage_.exact).cwiseAbs2().cwiseQuotient(fit.response_variance).mean();
  EXPECT_GT(ratio, 0.7);
  EXPECT_LT(ratio, 1.4);
}

TEST_F(LowRankFit, ARankThatIsTooLowIsSaid) {
  options_.residue_rank = 1;
  options_.rigid_body_rank = 1;  // it has three degrees of freedom
  const FitResult fit = fit_additive_model(stage_.frf, stage_.truth, options_);
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("more than noise explains")));
}

TEST_F(LowRankFit, EndsWhereNoFactorLowersTheCost) {
  options_.residue_rank = 1;
  options_.rigid_body_rank = 3;
  const FitResult fit = fit_additive_model(stage_.frf, stage_.truth, options_);
  const Eigen::MatrixXd W = stage_.frf.noise_variance.cwiseInverse();
  const auto cost = [&](const AdditiveModel& model) {
    const Eigen::MatrixXcd E =
        stage_.frf.response - response(model, stage_.frf.frequency_hz, HoldModel::exact);
    return (W.array() * E.cwiseAbs2().array()).sum();
  };
  AdditiveModel moved = fit.model;
  Eigen::MatrixXd& B = moved.submodels[3].numerator[0];
  const Eigen::MatrixXd best = B;
  const double least = cost(moved);
  for (Eigen::Index y = 0; y < best.rows(); ++y) {  // scale one output's shape up and down
    for (const double factor : {1.01, 0.99}) {
      B = best;
      B.row(y) *= factor;
      EXPECT_GT(cost(moved), least) << "output " << y << " times " << factor;
    }
  }
}

TEST_F(LowRankFit, TheNumberOfThreadsDoesNotChangeABit) {
  options_.residue_rank = 1;
  options_.threads = 1;
  const FitResult one = fit_additive_model(stage_.frf, stage_.truth, options_);
  options_.threads = 2;
  test::expect_same(one, fit_additive_model(stage_.frf, stage_.truth, options_));
}

// General viscous damping: complex shapes, residue psi_l psi_r^T of every pole; no noise.
TEST(LowRankViscousFit, RecoversComplexShapes) {
  test::RandomNumbers random(21);
  test::DenseProblem problem;
  problem.model = test::named_model(3, 4);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(400, 20.0, 800.0);
  for (const double f : {150.0, 310.0, 322.0, 600.0}) {
    problem.model.submodels.push_back(test::empty_mode(problem.model, f, 0.01, 2));
    Submodel& s = problem.model.submodels.back();
    const double omega = 2.0 * std::numbers::pi * f;
    const std::complex<double> pole(-0.01 * omega, omega * std::sqrt(1.0 - 1e-4));
    Eigen::VectorXcd left(3);
    Eigen::VectorXcd right(4);
    for (auto& value : left) value = random.circular();
    for (auto& value : right) value = random.circular();
    const Eigen::MatrixXcd residue = left * right.transpose();
    s.numerator[0] = -2.0 * s.denominator[2] * (std::conj(pole) * residue).real();
    s.numerator[1] = 2.0 * s.denominator[2] * residue.real();
  }
  test::measure(problem);
  AdditiveModel start = problem.model;
  for (Submodel& s : start.submodels) {
    s.denominator[2] *= 1.002;
    for (Eigen::MatrixXd& B : s.numerator) B.setZero();
  }
  FitOptions options;
  options.residue_rank = 1;
  const FitResult fit = fit_additive_model(test::frf_of(problem), start, options);
  EXPECT_LT(fit.model.fit.relative_rms_error, 1e-9) << fit.message();
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT(
        (fit.model.submodels[i].numerator[1] - problem.model.submodels[i].numerator[1]).norm(),
        1e-7 * problem.model.submodels[i].numerator[1].norm());
}

/// A body on springs and a broad mode below the lines, and two modes with residues of rank one.
test::DenseProblem suspended_body() {
  test::RandomNumbers random(5);
  test::DenseProblem problem;
  problem.model = test::named_model(2, 3);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(197, 16.0, 800.0);
  const auto add = [&](double frequency_hz, double damping, const Eigen::MatrixXd& stiffness) {
    problem.model.submodels.push_back(test::empty_mode(problem.model, frequency_hz, damping));
    problem.model.submodels.back().numerator[0] = stiffness;
  };
  add(0.4, 0.2, 1000.0 * random_matrix(random, 2, 3));
  add(0.5, 0.1, 1000.0 * random_matrix(random, 2, 3));
  add(9.0, 0.5, random_matrix(random, 2, 3));
  for (const double frequency_hz : {181.0, 422.0})
    add(frequency_hz, 0.015, random_matrix(random, 2, 1) * random_matrix(random, 1, 3));
  for (const std::size_t i : {0, 1}) {
    problem.model.submodels[i].role = SubmodelRole::suspension;
    problem.model.submodels[i].held = HeldPole::frequency;
  }
  test::measure(problem);
  return problem;
}

TEST(LowRankSuspensionFit, ConvergesAlongPolesThatTheLinesHardlyDetermine) {
  const test::DenseProblem problem = suspended_body();
  FitOptions options = test::fit_options(Weighting::noise_variance);
  options.residue_rank = 1;
  for (const std::uint64_t seed : {1, 8, 19}) {  // linear steps of the factors stall on these
    const FitResult fit =
        fit_additive_model(test::noisy(problem, 5e-3, seed), problem.model, options);
    EXPECT_TRUE(fit.trustworthy()) << seed << ": " << fit.message();
  }
}

}  // namespace stageid::test_low_rank
