#include "tests/support/stages/dahl_friction.hpp"

#include <gtest/gtest.h>

namespace stageid::test_dahl_friction {

TEST(DahlFriction, HoldsItsForceAtStandstill) {
  DahlFriction friction(2.0, 1e6);
  const double force_n = friction.move_to(1e-6);
  EXPECT_EQ(friction.move_to(1e-6), force_n);
}

// From a reversal on the force is F (1 - 2 exp(-k x / F)); over each of the two ways of length 2 X it does the work
// F 2 X - 2 F^2 / k.
TEST(DahlFriction, CostsTheHysteresisOfACycle) {
  constexpr double kForce = 2.0;
  constexpr double kStiffness = 1e6;
  constexpr double kAmplitude = 50e-6;
  constexpr int kSteps = 200000;
  DahlFriction friction(kForce, kStiffness);
  friction.move_to(-1e-3);
  friction.move_to(kAmplitude);
  double work = 0.0;
  double last = friction.move_to(kAmplitude);
  double at = kAmplitude;
  for (int i = 1; i <= 2 * kSteps; ++i) {
    const double to = i <= kSteps ? kAmplitude - 2.0 * kAmplitude * i / kSteps
                                  : -kAmplitude + 2.0 * kAmplitude * (i - kSteps) / kSteps;
    const double force = friction.move_to(to);
    work -= 0.5 * (force + last) * (to - at);
    last = force;
    at = to;
  }
  const double expected = 2.0 * (kForce * 2.0 * kAmplitude - 2.0 * kForce * kForce / kStiffness);
  EXPECT_NEAR(work / expected, 1.0, 1e-4);
}

}  // namespace stageid::test_dahl_friction
