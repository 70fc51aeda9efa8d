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

namespace stageid {
namespace test_factored_equations {

using test::DenseProblem;

TEST(FactoredEquations, GiveTheStepOfTheSums) {
  const DenseProblem problem = test::noisy_stage(HoldModel::exact, 1e-4);
  for (const DelayModel delay : {DelayModel::fixed, DelayModel::per_channel}) {
    auto [fit, beta, groups] = test::Evaluated(problem, delay);
    double cost = 0.0;
    ASSERT_TRUE(solve_numerators(fit, groups, beta.B, cost));
    const FactoredEquations factored(fit, beta, groups);
    const ArrowSystem summed(fit, beta, groups, FitMethod::gn);
    for (const double damping : {0.0, 0.1})
      for (const std::vector<Eigen::Index>& frozen : {std::vector<Eigen::Index>{}, {1, 2}}) {
        const Eigen::VectorXd step = factored.solve_globals(damping, frozen);
        const Eigen::VectorXd same = summed.solve_globals(damping, frozen);
        for (const Eigen::Index i : frozen) EXPECT_EQ(step[i], 0.0);
        // Damping is relative to the columns before elimination there, and after it here.
        if (damping == 0.0) {
          EXPECT_LT((step - same).norm(), 1e-6 * same.norm());
        } else {
          EXPECT_GT(step.dot(summed.schur_gradient()), 0.0) << "a descent";
        }
      }
    EXPECT_LT((factored.schur() - summed.schur()).norm(), 1e-8 * summed.schur().norm());
    EXPECT_LT((factored.schur_gradient() - summed.schur_gradient()).norm(),
              1e-8 * summed.schur_gradient().norm());
  }
}

// Two poles that differ in the eighth digit: normal equations leave 1e-9 of exact data, and more.
TEST(FactoredEquations, NumeratorsHaveAllDigitsOfExactData) {
  DenseProblem problem = test::noisy_stage(HoldModel::none, 0.0);
  Submodel twin = problem.model.submodels[1];
  twin.denominator[2] *= 1.0 + 1e-8;
  problem.model.submodels.push_back(twin);
  problem.G = test::reference_response(problem.model, problem.frequency_hz, problem.hold);
  problem.W = problem.G.cwiseAbs2().cwiseInverse();
  const auto [fit, beta, groups] = test::Evaluated(problem, DelayModel::fixed, false);
  Eigen::MatrixXd B;
  double cost = 0.0;
  bool factored = false;
  ASSERT_TRUE(solve_numerators(fit, groups, B, cost, factored));
  EXPECT_TRUE(factored);
  EXPECT_LT(std::sqrt(2.0 * cost / static_cast<double>(fit.channels())), 1e-13);
  EXPECT_NEAR(residual_cost(fit, groups, B), cost, 0.5 * cost);
}

TEST(FactoredEquations, NumeratorsOfNoisyDataAreThoseOfTheSums) {
  const DenseProblem problem = test::noisy_stage(HoldModel::exact, 1e-4);
  const auto [fit, beta, groups] = test::Evaluated(problem, DelayModel::fixed, false);
  Eigen::MatrixXd summed;
  Eigen::MatrixXd by_factors;
  double cost = 0.0;
  double cost_by_factors = 0.0;
  bool factored = false;
  ASSERT_TRUE(solve_numerators(fit, groups, summed, cost, factored));
  EXPECT_FALSE(factored) << "the sums have all the digits that noise leaves";
  factored = true;
  ASSERT_TRUE(solve_numerators(fit, groups, by_factors, cost_by_factors, factored));
  EXPECT_LT((summed - by_factors).cwiseAbs().maxCoeff(), 1e-9 * summed.cwiseAbs().maxCoeff());
  EXPECT_NEAR(cost, cost_by_factors, 1e-10 * cost);
}

TEST(FactoredEquations, CoincidingModesAreSingular) {
  DenseProblem problem = test::noisy_stage(HoldModel::none, 0.0);
  problem.model.submodels.push_back(problem.model.submodels[1]);
  const auto [fit, beta, groups] = test::Evaluated(problem, DelayModel::fixed, false);
  Eigen::MatrixXd B;
  double cost = 0.0;
  bool factored = true;
  EXPECT_FALSE(solve_numerators(fit, groups, B, cost, factored));
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
  const auto part = [&](Eigen::Index i) { return parts[static_cast<std::size_t>(i)]; };
  const Eigen::MatrixXd R = stacked_triangle(19, 2, part);
  EXPECT_LT((R.transpose() * R - products).norm(), 1e-12 * products.norm());
  EXPECT_EQ(R, stacked_triangle(19, 1, part));
  EXPECT_TRUE(R.isUpperTriangular());
}

}  // namespace test_factored_equations
}  // namespace stageid
