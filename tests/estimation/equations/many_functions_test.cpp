// Few channels with many functions: sums of fractions while there is noise, orthogonal factors where nothing is left but
// digits; and globals that are known, which no equation has columns of.

#include <gtest/gtest.h>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/factored_equations.hpp"
#include "estimation/equations/numerators.hpp"
#include "estimation/iteration/fit_iteration.hpp"
#include "tests/estimation/disturbed_problem.hpp"

namespace stageid::test_many_functions {

using test::DenseProblem;

/// 2 x 3 channels, 36 modes with B_0 + B_1 s: 72 functions, each mode as wide as half the way to the next.
DenseProblem many_functions() {
  test::RandomNumbers random(37);
  DenseProblem problem;
  problem.hold = HoldModel::none;
  problem.model = test::named_model(2, 3);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(600, 5.0, 1500.0);
  for (int i = 1; i <= 36; ++i)
    problem.model.submodels.push_back(test::empty_mode(problem.model, 40.0 * i, 0.03, 2));
  test::measure_and_disturb(random, problem, 1e-3);
  return problem;
}

void expect_same(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-8 * b.cwiseAbs().maxCoeff());
}

TEST(ManyFunctions, AreSummedAsFractionsToEightDigits) {
  const DenseProblem problem = many_functions();
  auto [fit, beta, groups] = test::Evaluated(problem);
  ASSERT_TRUE(solve_numerators(fit, groups, beta.B));
  const ArrowSystem summed(fit, beta, groups, FitMethod::gn);
  const FactoredEquations factored(fit, beta, groups);
  // The elimination of the numerators costs a digit.
  EXPECT_LT((summed.schur() - factored.schur()).norm(), 1e-7 * factored.schur().norm());
  expect_same(summed.schur_gradient(), factored.schur_gradient());
}

// With exact poles, the residual is only rounding.
TEST(ManyFunctions, ExactPolesLeaveRoundingOnly) {
  DenseProblem problem = many_functions();
  test::measure(problem);
  problem.W = problem.G.cwiseAbs2().cwiseInverse();
  const FitProblem fit = test::fit_problem(problem, DelayModel::fixed);
  FitParameters beta = test::fit_parameters(problem);
  FitOptions as_placed;
  as_placed.max_iterations = 0;
  const IterationResult result = iterate(fit, beta, as_placed);
  EXPECT_LT(std::sqrt(result.end_cost / signal_cost(fit)), 1e-12);
}

TEST(HeldGlobals, HaveNoEquationsAndLeaveThoseOfTheOthers) {
  const DenseProblem problem = many_functions();
  FitProblem fit = test::fit_problem(problem, DelayModel::fixed);
  const FitParameters beta = test::fit_parameters(problem);
  const ArrowSystem free(fit, beta, evaluate_groups(fit, beta, true), FitMethod::gn);
  fit.held = {3, 10, 11};  // one of a mode, and both of another
  std::vector<Eigen::Index> others;
  for (Eigen::Index i = 0; i < fit.globals(); ++i)
    if (std::ranges::find(fit.held, i) == fit.held.end()) others.push_back(i);
  const std::vector<BasisGroup> groups = evaluate_groups(fit, beta, true);
  EXPECT_EQ(groups.at(0).D.re.cols(), 2 * (fit.globals() - 3));
  const ArrowSystem held(fit, beta, groups, FitMethod::gn);
  expect_same(held.M_globals()(others, others), free.M_globals()(others, others));
  expect_same(held.e_globals()(others), free.e_globals()(others));
  EXPECT_EQ(held.M_globals()(fit.held, others).norm(), 0.0);
  EXPECT_EQ(held.channel(0).ab(fit.held, Eigen::all).norm(), 0.0);
}

}  // namespace stageid::test_many_functions
