#include "hal/simulator/modal_plant.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>

#include "hal/simulator/mode_transition.hpp"
#include "tests/hal/simulator/closed_loop_model.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_modal_plant {

using Eigen::MatrixXd;
using Eigen::VectorXd;
constexpr double kTwoPi = 2.0 * std::numbers::pi;

std::vector<PlantMode> two_modes() {
  return {{40.0, 0.02, VectorXd{{1.0, -0.5}}, VectorXd{{0.8, 0.3}}},
          {210.0, 0.005, VectorXd{{0.4, 1.2}}, VectorXd{{-0.6, 1.0}}}};
}

class DelayedPlant : public testing::TestWithParam<double> {};

TEST_P(DelayedPlant, FollowsTheMatrixExponential) {
  const double rate_hz = 1000.0;
  const double delay_s = GetParam() / rate_hz;
  const test::DenseModel model = test::plant_model(two_modes(), delay_s, rate_hz);
  ModalPlant plant(two_modes(), delay_s, rate_hz);
  std::mt19937_64 engine(3);
  std::normal_distribution<double> normal;
  VectorXd x = VectorXd::Zero(model.a.rows());
  VectorXd y(2);
  double largest = 0.0;
  double error = 0.0;
  for (int n = 0; n < 80; ++n) {
    plant.output(y.data());  // y[n] before u[n]: causal
    const VectorXd exact = model.c * x;
    largest = std::max(largest, y.norm());
    error = std::max(error, (y - exact).norm());
    const VectorXd u{{normal(engine), normal(engine)}};
    plant.step(u.data());
    x = model.a * x + model.b * u;
  }
  EXPECT_GT(largest, 1e-6);
  EXPECT_LT(error, 1e-12 * largest);  // rounding, 80 steps
}

INSTANTIATE_TEST_SUITE_P(AnyDelay, DelayedPlant, testing::Values(0.0, 0.37, 1.0, 1.3, 2.0, 4.999));

TEST(ModalPlant, MovesAFreeMassByNewtonsLaw) {
  const double rate_hz = 1e4;
  const PlantMode free_mass{0.0, 0.0, VectorXd{{0.5}}, VectorXd{{0.5}}};  // 4 kg
  ModalPlant plant({free_mass}, 0.0, rate_hz);
  const double u = 3.0;
  constexpr int kSteps = 10000;
  for (int n = 0; n < kSteps; ++n) plant.step(&u);
  double y = 0.0;
  plant.output(&y);
  EXPECT_NEAR(y, 0.5 * 3.0 / 4.0, 1e-10);  // a t^2 / 2 after 1 s
}

TEST(ModalPlant, ResetForgetsEverything) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  ModalPlant used(plant_modes(spec.info, spec.plant), spec.info.delay_s, 1e4);
  ModalPlant fresh(plant_modes(spec.info, spec.plant), spec.info.delay_s, 1e4);
  const VectorXd u = VectorXd::LinSpaced(17, -1.0, 1.0);
  for (int n = 0; n < 7; ++n) used.step(u.data());
  used.add_modal_force(2, 1.0);
  used.reset();
  VectorXd y_used(7);
  VectorXd y_fresh(7);
  for (int n = 0; n < 7; ++n) {
    used.step(u.data());
    fresh.step(u.data());
    used.output(y_used.data());
    fresh.output(y_fresh.data());
    EXPECT_EQ(y_used, y_fresh);
  }
}

TEST(ModalPlant, RefusesWhatCannotBeSimulated) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](auto change) {
    std::vector<PlantMode> modes = two_modes();
    double delay_s = 0.0;
    double rate_hz = 1e3;
    change(modes, modes[1], delay_s, rate_hz);
    EXPECT_THROW(ModalPlant(modes, delay_s, rate_hz), std::invalid_argument);
  };
  refused([](auto& modes, auto&, auto&, auto&) { modes.clear(); });
  for (const double bad_s : {-1e-6, nan, 1e6})
    refused([&](auto&, auto&, auto& delay_s, auto&) { delay_s = bad_s; });
  refused([](auto&, auto&, auto&, auto& rate_hz) { rate_hz = 0.0; });
  refused([](auto&, auto& m, auto&, auto&) { m.damping_ratio = 1.0; });
  refused([](auto&, auto& m, auto&, auto&) { m.natural_frequency_hz = -1.0; });
  refused([](auto&, auto& m, auto&, auto&) { m.sensor_shape.resize(1); });
  refused([&](auto&, auto& m, auto&, auto&) { m.actuator_shape[0] = nan; });
}

struct TransitionCase {
  double frequency_hz, damping, duration_s;
};
class ModeTransitions : public testing::TestWithParam<TransitionCase> {};

// In a unit of time in which all entries are of order one, as the general exponential requires.
TEST_P(ModeTransitions, IsTheMatrixExponential) {
  const auto [frequency_hz, damping, duration_s] = GetParam();
  const double wt = kTwoPi * frequency_hz * duration_s;
  const MatrixXd e = test::matrix_exponential(
      MatrixXd{{0.0, 1.0, 0.0}, {-wt * wt, -2.0 * damping * wt, 1.0}, {0.0, 0.0, 0.0}});
  const ModeTransition p = mode_transition(kTwoPi * frequency_hz, damping, duration_s);
  const double tolerance = 1e-13 * (1.0 + wt * wt);
  EXPECT_NEAR(p.transition(0, 0), e(0, 0), tolerance);
  EXPECT_NEAR(p.transition(0, 1) / duration_s, e(0, 1), tolerance);
  EXPECT_NEAR(p.transition(1, 0) * duration_s, e(1, 0), tolerance * (1.0 + wt));
  EXPECT_NEAR(p.transition(1, 1), e(1, 1), tolerance);
  EXPECT_NEAR(p.input[0] / (duration_s * duration_s), e(0, 2), tolerance);
  EXPECT_NEAR(p.input[1] / duration_s, e(1, 2), tolerance);
}

INSTANTIATE_TEST_SUITE_P(
    AllKinds, ModeTransitions,
    testing::Values(TransitionCase{0.0, 0.0, 1e-4}, TransitionCase{0.3, 0.1, 1e-4},
                    TransitionCase{210.0, 0.0, 1e-3}, TransitionCase{2600.0, 0.005, 1e-4},
                    TransitionCase{5000.0, 0.9, 1e-3}, TransitionCase{100.0, 1.0, 1e-3},
                    TransitionCase{100.0, 2.0, 1e-3}));

TEST(ModeTransitions, OverNoTimeIsTheIdentity) {
  const ModeTransition p = mode_transition(10.0, 0.1, 0.0);
  EXPECT_EQ(p.transition, Eigen::Matrix2d::Identity());
  EXPECT_EQ(p.input, Eigen::Vector2d::Zero());
}

TEST(ModalPlant, GoesOnFromItsStateWithARetunedMode) {
  std::vector<PlantMode> modes = two_modes();
  ModalPlant retuned(modes, 0.6e-3, 1000.0);
  retuned.retune(1, 190.0, 0.01);
  modes[1].natural_frequency_hz = 190.0;
  modes[1].damping_ratio = 0.01;
  ModalPlant other(modes, 0.6e-3, 1000.0);
  const VectorXd u{{1.0, -2.0}};
  VectorXd a(2);
  VectorXd b(2);
  for (int n = 0; n < 50; ++n) {
    retuned.step(u.data());
    other.step(u.data());
    retuned.output(a.data());
    other.output(b.data());
    ASSERT_EQ(a, b);
  }
  const double before = retuned.coordinate(1);
  retuned.retune(1, 170.0, 0.01);
  EXPECT_EQ(retuned.coordinate(1), before);
}

}  // namespace stageid::test_modal_plant
