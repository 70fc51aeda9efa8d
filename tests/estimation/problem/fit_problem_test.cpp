#include "estimation/problem/fit_problem.hpp"

#include <gtest/gtest.h>

#include "tests/estimation/disturbed_problem.hpp"

namespace stageid::test_fit_problem {

/// 5 x 9 channels, each with its own delay.
test::DenseProblem many_delays() {
  test::RandomNumbers random(41);
  test::DenseProblem problem;
  problem.hold = HoldModel::none;
  problem.model = test::named_model(5, 9);
  problem.model.input_delay_s = Eigen::VectorXd::LinSpaced(9, 0.0, 9e-4);
  problem.model.output_delay_s = Eigen::VectorXd::LinSpaced(5, 1.7e-5, 0.0);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(40, 5.0, 1500.0);
  for (const double hz : {40.0, 90.0, 91.0})
    problem.model.submodels.push_back(test::empty_mode(problem.model, hz, 0.03, 2));
  test::measure_and_disturb(random, problem, 1e-3);
  return problem;
}

TEST(BasisGroups, AreTheSameAllTogetherAndAFewAtATime) {
  const test::Evaluated all(many_delays(), DelayModel::per_channel);
  ASSERT_EQ(all.groups.size(), 45U);
  std::size_t i = 0;
  BasisGroups(all.fit, all.beta, true).for_each([&](const BasisGroup& group) {
    const BasisGroup& expected = all.groups[i++];
    EXPECT_EQ(group.delay_s, expected.delay_s);
    EXPECT_EQ(group.channels, expected.channels);
    EXPECT_EQ(group.F, expected.F);
    EXPECT_EQ(group.D, expected.D);
    EXPECT_EQ(group.T, expected.T);
    EXPECT_EQ(*group.fractions.base, *expected.fractions.base);
    EXPECT_EQ(&*expected.fractions.base, &*all.groups[0].fractions.base);  // one for all
  });
  EXPECT_EQ(i, all.groups.size());
}

}  // namespace stageid::test_fit_problem
