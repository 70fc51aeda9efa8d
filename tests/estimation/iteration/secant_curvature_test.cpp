#include "estimation/iteration/secant_curvature.hpp"

#include <gtest/gtest.h>

namespace stageid::test_secant_curvature {

/// A quadratic cost with Hessian H, of which Gauss-Newton sees M.
struct Valley {
  Eigen::Matrix3d H{{4.0, 1.0, 0.0}, {1.0, 3.0, 0.5}, {0.0, 0.5, 2.0}};
  Eigen::Matrix3d M{{3.9, 1.0, 0.0}, {1.0, 2.9, 0.5}, {0.0, 0.5, 0.01}};
  Eigen::Vector3d descent(const Eigen::Vector3d& x) const { return -H * x; }
};

TEST(SecantCurvature, StepsAlongWhatWasLearnedAreThoseOfNewton) {
  const Valley valley;
  SecantCurvature curvature;
  const Eigen::Vector3d x(0.3, -0.2, 1.0);
  const Eigen::Vector3d moved(0.01, 0.02, -0.3);
  curvature.learn(valley.M, valley.descent(x), {});
  EXPECT_FALSE(curvature.step({}).has_value());
  curvature.learn(valley.M, valley.descent(x + moved), moved);
  curvature.learn(valley.M, valley.descent(-moved), {});
  const auto step = curvature.step({});
  ASSERT_TRUE(step.has_value());
  EXPECT_LT((*step - moved).norm(), 1e-12) << step->transpose();
}

TEST(SecantCurvature, AWeakDirectionNeedsFewSteps) {
  const Valley valley;
  SecantCurvature curvature;
  Eigen::Vector3d x(0.3, -0.2, 1.0);
  Eigen::VectorXd moved;
  int steps = 0;
  for (; steps < 20 && valley.descent(x).norm() > 1e-9; ++steps) {
    curvature.learn(valley.M, valley.descent(x), moved);
    // By Gauss-Newton, the third coordinate would be 200 times too long.
    moved = curvature.step({}).value_or(0.003 * valley.M.inverse() * valley.descent(x));
    x += moved;
  }
  EXPECT_LE(steps, 8);
}

TEST(SecantCurvature, FrozenParametersDoNotMove) {
  const Valley valley;
  SecantCurvature curvature;
  const Eigen::Vector3d moved(0.1, 0.2, -0.3);
  curvature.learn(valley.M, valley.descent({1.0, 1.0, 1.0}), {});
  curvature.learn(valley.M, valley.descent(Eigen::Vector3d(1.0, 1.0, 1.0) + moved), moved);
  const auto step = curvature.step({1});
  ASSERT_TRUE(step.has_value());
  EXPECT_EQ((*step)[1], 0.0);
  EXPECT_NE((*step)[0], 0.0);
}

TEST(SecantCurvature, ADirectionOfNegativeCurvatureIsNotLearned) {
  SecantCurvature curvature;
  const Eigen::Matrix2d M = Eigen::Matrix2d::Identity();
  curvature.learn(M, Eigen::Vector2d(1.0, 0.0), {});
  curvature.learn(M, Eigen::Vector2d(1.5, 0.0), Eigen::Vector2d(0.5, 0.0));
  EXPECT_FALSE(curvature.step({}).has_value());
}

}  // namespace stageid::test_secant_curvature
