// Steps and numerators by orthogonal factors, against those by sums of products and where those have no digits left.

#include "estimation/equations/factored_equations.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/numerators.hpp"
#include "estimation/equations/triangles.hpp"
#include "estimation/problem/residual.hpp"
#include "tests/estimation/disturbed_problem.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test_factored_equations {

using test::DenseProblem;

/// In units of the deviations: entries of different size count alike.
double difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const Eigen::VectorXd scale = b.diagonal().cwiseSqrt().cwiseInverse();
  return (scale.asDiagonal() * (a - b) * scale.asDiagonal()).cwiseAbs().maxCoeff();
}

TEST(FactoredEquations, GiveTheStepOfTheSums) {
  const DenseProblem problem = test::noisy_stage(HoldModel::exact, 1e-4);
  for (const DelayModel delay : {DelayModel::fixed, DelayModel::per_channel}) {
    auto [fit, beta, groups] = test::Evaluated(problem, delay);
    Eigen::MatrixXd weights = *fit.W;
    weights.row(2).setZero();  // a channel without data
    fit.W = weights;
    ASSERT_TRUE(solve_numerators(fit, groups, beta.B));
    const FactoredEquations factored(fit, beta, groups);
    const ArrowSystem summed(fit, beta, groups, FitMethod::gn);
    const Eigen::VectorXd scale = summed.schur().diagonal().cwiseSqrt();
    for (const double damping : {0.0, 0.1})
      for (const std::vector<Eigen::Index>& frozen : {std::vector<Eigen::Index>{}, {1, 2}}) {
        const Eigen::VectorXd step = factored.solve_globals(damping, frozen);
        const Eigen::VectorXd same = summed.solve_globals(damping, frozen);
        for (const Eigen::Index i : frozen) EXPECT_EQ(step[i], 0.0);
        EXPECT_LT((step - same).cwiseProduct(scale).norm(), 1e-6 * same.cwiseProduct(scale).norm());
      }
    EXPECT_LT(difference(factored.schur(), summed.schur()), 1e-8);
    EXPECT_LT((factored.schur_gradient() - summed.schur_gradient()).cwiseQuotient(scale).norm(),
              1e-8 * summed.schur_gradient().cwiseQuotient(scale).norm());
  }
}

TEST(FactoredEquations, HeldGlobalsHaveNoPart) {
  const DenseProblem problem = test::noisy_stage(HoldModel::none, 1e-4);
  FitProblem fit = test::fit_problem(problem, DelayModel::fixed);
  fit.held = {0, 3};
  FitParameters beta = test::fit_parameters(problem);
  const std::vector<BasisGroup> groups = evaluate_groups(fit, beta, true);
  ASSERT_TRUE(solve_numerators(fit, groups, beta.B));
  const FactoredEquations factored(fit, beta, groups);
  const ArrowSystem summed(fit, beta, groups, FitMethod::gn);
  const Eigen::VectorXd step = factored.solve_globals(0.0, fit.held);
  EXPECT_EQ(step[0], 0.0);
  EXPECT_EQ(step[3], 0.0);
  const Eigen::VectorXd same = summed.solve_globals(0.0, fit.held);
  EXPECT_LT((step - same).norm(), 1e-6 * same.norm());
}

// Fewer real data per channel than unknowns: the channels determine the globals together.
TEST(FactoredEquations, FewLinesSuffice) {
  DenseProblem problem = test::noisy_stage(HoldModel::none, 1e-4);
  const auto lines = Eigen::seqN(20, 4, 60);
  problem.frequency_hz = Eigen::VectorXd(problem.frequency_hz(lines));
  problem.G = Eigen::MatrixXcd(problem.G(Eigen::all, lines));
  problem.W = Eigen::MatrixXd(problem.W(Eigen::all, lines));
  auto [fit, beta, groups] = test::Evaluated(problem);
  ASSERT_LT(2 * fit.size(), fit.functions() + fit.globals() + 1);
  ASSERT_TRUE(solve_numerators(fit, groups, beta.B));
  const FactoredEquations factored(fit, beta, groups);
  const ArrowSystem summed(fit, beta, groups, FitMethod::gn);
  EXPECT_LT(difference(factored.schur(), summed.schur()), 1e-7);
}

// Two poles that differ in the eighth digit: normal equations leave 1e-9 of exact data, and more.
TEST(FactoredEquations, NumeratorsHaveAllDigitsOfExactData) {
  DenseProblem problem = test::noisy_stage(HoldModel::none, 0.0);
  Submodel twin = problem.model.submodels[1];
  twin.denominator[2] *= 1.0 + 1e-8;
  problem.model.submodels.push_back(twin);
  test::measure(problem);
  problem.W = problem.G.cwiseAbs2().cwiseInverse();
  const auto [fit, beta, groups] = test::Evaluated(problem, DelayModel::fixed, false);
  Eigen::MatrixXd B;
  const auto solved = solve_numerators(fit, groups, B);
  ASSERT_TRUE(solved);
  EXPECT_TRUE(solved->factored);
  EXPECT_LT(std::sqrt(2.0 * solved->cost / static_cast<double>(fit.channels())), 1e-13);
  EXPECT_NEAR(residual_cost(fit, groups, B), solved->cost, 0.5 * solved->cost);
}

TEST(FactoredEquations, NumeratorsOfNoisyDataAreThoseOfTheSums) {
  const DenseProblem problem = test::noisy_stage(HoldModel::exact, 1e-4);
  const auto [fit, beta, groups] = test::Evaluated(problem, DelayModel::fixed, false);
  Eigen::MatrixXd summed;
  Eigen::MatrixXd by_factors;
  double squares = 0.0;
  const auto solved = solve_numerators(fit, groups, summed);
  ASSERT_TRUE(solved);
  const double cost = solved->cost;
  EXPECT_FALSE(solved->factored) << "the sums have all the digits that noise leaves";
  const TileRange all{0, fit.channels(), 0, fit.size()};
  ASSERT_TRUE(factored_numerators(fit, groups[0], all, by_factors, squares));
  EXPECT_LT((summed - by_factors).cwiseAbs().maxCoeff(), 1e-9 * summed.cwiseAbs().maxCoeff());
  EXPECT_NEAR(cost, squares / (2.0 * static_cast<double>(fit.size())), 1e-10 * cost);
}

TEST(FactoredEquations, CoincidingModesAreSingular) {
  DenseProblem problem = test::noisy_stage(HoldModel::none, 0.0);
  problem.model.submodels.push_back(problem.model.submodels[1]);
  const auto [fit, beta, groups] = test::Evaluated(problem, DelayModel::fixed, false);
  Eigen::MatrixXd B;
  double squares = 0.0;
  const TileRange all{0, fit.channels(), 0, fit.size()};
  EXPECT_FALSE(factored_numerators(fit, groups[0], all, B, squares));
}

TEST(StackedTriangle, HasTheProductsOfAllMatrices) {
  test::RandomNumbers random(3);
  std::vector<Eigen::MatrixXd> parts;
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(4, 4);
  for (int i = 0; i < 19; ++i) {
    parts.push_back(
        Eigen::MatrixXd(test::random_matrix(random, 4, 4).triangularView<Eigen::Upper>()));
    products += parts.back().transpose() * parts.back();
  }
  const auto part = [&](Eigen::Index i) { return parts[i]; };
  const Eigen::MatrixXd R = stacked_triangle(19, 2, part);
  EXPECT_LT((R.transpose() * R - products).norm(), 1e-12 * products.norm());
  EXPECT_EQ(R, stacked_triangle(19, 1, part));
  EXPECT_TRUE(R.isUpperTriangular());
}

}  // namespace stageid::test_factored_equations
