#include "hal/simulator/modal_plant.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <numbers>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <unsupported/Eigen/MatrixFunctions>

#include "hal/simulator/mode_transition.hpp"
#include "tests/hal/measured_response.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_modal_plant {

using Eigen::MatrixXd;
using Eigen::VectorXd;
constexpr double kTwoPi = 2.0 * std::numbers::pi;

std::vector<PlantMode> two_modes() {
  return {{40.0, 0.02, VectorXd{{1.0, -0.5}}, VectorXd{{0.8, 0.3}}},
          {210.0, 0.005, VectorXd{{0.4, 1.2}}, VectorXd{{-0.6, 1.0}}}};
}

// The same plant as one dense continuous-time system, x = [q; q' / v]. v makes the entries of a T of order one, as the
// general matrix exponential requires.
struct StateSpace {
  MatrixXd a, b, c;
};

StateSpace dense(const std::vector<PlantMode>& modes) {
  const auto n = static_cast<Eigen::Index>(modes.size());
  StateSpace s{MatrixXd::Zero(2 * n, 2 * n), MatrixXd::Zero(2 * n, modes[0].actuator_shape.size()),
               MatrixXd::Zero(modes[0].sensor_shape.size(), 2 * n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const PlantMode& mode = modes[i];
    const double omega = kTwoPi * mode.natural_frequency_hz;
    constexpr double kV = 1000.0;
    s.a(i, n + i) = kV;
    s.a(n + i, i) = -omega * omega / kV;
    s.a(n + i, n + i) = -2.0 * mode.damping_ratio * omega;
    s.b.row(n + i) = mode.actuator_shape.transpose() / kV;
    s.c.col(i) = mode.sensor_shape;
  }
  return s;
}

// Advances x over `duration_s` with constant u, by the exponential of the augmented matrix.
VectorXd advance(const StateSpace& s, const VectorXd& x, const VectorXd& u, double duration_s) {
  const Eigen::Index n = x.size();
  MatrixXd augmented = MatrixXd::Zero(n + 1, n + 1);
  augmented.topLeftCorner(n, n) = s.a * duration_s;
  augmented.topRightCorner(n, 1) = s.b * u * duration_s;
  const MatrixXd exponential = augmented.exp();
  return exponential.topLeftCorner(n, n) * x + exponential.topRightCorner(n, 1);
}

class DelayedPlant : public testing::TestWithParam<double> {};

// Continuous time is divided at the sample instants and at the jumps of the input, for any number of jumps between two
// samples.
TEST_P(DelayedPlant, FollowsTheMatrixExponentialOfTheWholeSystem) {
  const double rate_hz = 1000.0;
  const double delay_samples = GetParam();
  const auto modes = two_modes();
  const StateSpace s = dense(modes);
  ModalPlant plant(modes, delay_samples / rate_hz, rate_hz);
  std::mt19937_64 engine(3);
  std::normal_distribution<double> normal;

  const auto whole = static_cast<int>(std::floor(delay_samples));
  const double fraction = delay_samples - whole;
  std::vector<VectorXd> u;
  const auto held = [&](int n) { return n < 0 ? VectorXd(VectorXd::Zero(2)) : u[n]; };
  VectorXd x = VectorXd::Zero(4);
  double largest = 0.0;
  double error = 0.0;
  for (int n = 0; n < 80; ++n) {
    u.push_back(VectorXd{{normal(engine), normal(engine)}});
    plant.step(u.back().data());
    x = advance(s, x, held(n - whole - 1), fraction / rate_hz);
    x = advance(s, x, held(n - whole), (1.0 - fraction) / rate_hz);
    VectorXd y(2);
    plant.output(y.data());
    largest = std::max(largest, y.norm());
    error = std::max(error, (y - s.c * x).norm());
  }
  EXPECT_GT(largest, 1e-6);
  EXPECT_LT(error, 1e-12 * largest);  // rounding, 80 steps
}

INSTANTIATE_TEST_SUITE_P(AnyDelay, DelayedPlant, testing::Values(0.0, 0.37, 1.0, 1.3, 2.0, 4.999));

TEST(ModalPlant, AgreesWithAnIndependentIntegration) {
  std::ifstream file(std::string(STAGEID_SOURCE_DIR) + "/tests/hal/reference/small_plant.csv");
  ASSERT_TRUE(file) << "tests/hal/reference/small_plant.csv is missing";
  ModalPlant plant(two_modes(), 1.7e-3, 1000.0);
  std::string line;
  std::getline(file, line);
  int rows = 0;
  while (std::getline(file, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    int sample = 0;
    double u[2];
    double y[2];
    fields >> sample >> u[0] >> u[1] >> y[0] >> y[1];
    double ours[2];
    plant.output(ours);  // y[n] before u[n]: causal
    // Responses are about 1e-5; the integrator was asked for 1e-13 of them a step.
    EXPECT_NEAR(ours[0], y[0], 1e-15 + 1e-10 * 1e-5) << "sample " << sample;
    EXPECT_NEAR(ours[1], y[1], 1e-15 + 1e-10 * 1e-5) << "sample " << sample;
    plant.step(u);
    ++rows;
  }
  EXPECT_EQ(rows, 60);
}

// Excites the plant with a periodic signal until the transient has decayed (the modes are well damped here), and
// compares its DFT with the closed form.
TEST(ModalPlant, ReachesTheClosedFormFrequencyResponse) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  auto modes = plant_modes(spec.info, spec.plant);
  for (PlantMode& mode : modes) {
    mode.damping_ratio = 0.3;
    mode.natural_frequency_hz = std::max(mode.natural_frequency_hz, 100.0);
  }
  const double rate_hz = 1e4;
  constexpr int kPeriod = 1000;
  constexpr int kPeriods = 3;  // slowest decay 0.3 * 2 pi 100 Hz: exp(-38) after two periods
  ModalPlant plant(modes, spec.info.delay_s, rate_hz);
  for (const int line : {1, 7, 20, 83, 199, 320, 499}) {
    const Eigen::Index input = line % 17;
    const Eigen::VectorXcd y = test::measured_response(
        plant, VectorXd::Unit(plant.actuators(), input), {line, kPeriod, kPeriods});
    const Eigen::VectorXcd exact =
        sampled_response(modes, spec.info.delay_s, rate_hz, line * rate_hz / kPeriod).col(input);
    EXPECT_LT((y - exact).norm(), 1e-9 * exact.norm()) << "line " << line;
  }
}

// A force held constant does the work u (y[n+1] - y[n]). Without damping and delay, and with collocated sensors, all of
// it must equal the vibration energy of the two modes.
TEST(ModalPlant, ConservesEnergy) {
  auto modes = two_modes();
  for (PlantMode& mode : modes) mode.damping_ratio = 0.0;
  std::vector<PlantMode> observed = modes;  // outputs: the two inputs' positions, then q1 and q2
  for (std::size_t i = 0; i < 2; ++i) {
    observed[i].sensor_shape = VectorXd::Zero(4);
    observed[i].sensor_shape.head<2>() = modes[i].actuator_shape;
    observed[i].sensor_shape[2 + i] = 1.0;
  }
  const double period_s = 1e-3;
  ModalPlant plant(observed, 0.0, 1.0 / period_s);
  std::mt19937_64 engine(5);
  std::normal_distribution<double> normal;
  VectorXd y = VectorXd::Zero(4);
  VectorXd next(4);
  double work = 0.0;
  for (int n = 0; n < 200; ++n) {
    const VectorXd u{{normal(engine), normal(engine)}};
    plant.step(u.data());
    plant.output(next.data());
    work += u.dot(next.head<2>() - y.head<2>());
    y = next;
  }
  const VectorXd zero = VectorXd::Zero(2);
  plant.step(zero.data());
  plant.output(next.data());
  double energy = 0.0;
  for (Eigen::Index i = 0; i < 2; ++i) {
    // Free vibration q = A cos(w t + p): two samples give A.
    const double omega = kTwoPi * modes[i].natural_frequency_hz;
    const double q0 = y[2 + i];
    const double q1 = next[2 + i];
    const double wt = omega * period_s;
    const double amplitude_squared =
        (q0 * q0 + q1 * q1 - 2.0 * q0 * q1 * std::cos(wt)) / std::pow(std::sin(wt), 2);
    energy += 0.5 * omega * omega * amplitude_squared;
  }
  EXPECT_GT(work, 0.0);
  EXPECT_NEAR(energy, work, 1e-10 * work);
}

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
  const auto with = [](auto change) {
    auto modes = two_modes();
    change(modes[1]);
    return modes;
  };
  EXPECT_THROW(ModalPlant({}, 0.0, 1e3), std::invalid_argument);
  EXPECT_THROW(ModalPlant(two_modes(), -1e-6, 1e3), std::invalid_argument);
  EXPECT_THROW(ModalPlant(two_modes(), nan, 1e3), std::invalid_argument);
  EXPECT_THROW(ModalPlant(two_modes(), 1e6, 1e3), std::invalid_argument);
  EXPECT_THROW(ModalPlant(two_modes(), 0.0, 0.0), std::invalid_argument);
  EXPECT_THROW(ModalPlant(with([](PlantMode& m) { m.damping_ratio = 1.0; }), 0.0, 1e3),
               std::invalid_argument);
  EXPECT_THROW(ModalPlant(with([](PlantMode& m) { m.natural_frequency_hz = -1.0; }), 0.0, 1e3),
               std::invalid_argument);
  EXPECT_THROW(ModalPlant(with([](PlantMode& m) { m.sensor_shape.resize(1); }), 0.0, 1e3),
               std::invalid_argument);
  EXPECT_THROW(ModalPlant(with([&](PlantMode& m) { m.actuator_shape[0] = nan; }), 0.0, 1e3),
               std::invalid_argument);
}

struct TransitionCase {
  double frequency_hz, damping, duration_s;
};
class ModeTransitions : public testing::TestWithParam<TransitionCase> {};

// In a unit of time in which all entries are of order one, as the general exponential requires.
TEST_P(ModeTransitions, IsTheMatrixExponential) {
  const auto [frequency_hz, damping, duration_s] = GetParam();
  const double wt = kTwoPi * frequency_hz * duration_s;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  a << 0.0, 1.0, 0.0, -wt * wt, -2.0 * damping * wt, 1.0, 0.0, 0.0, 0.0;
  const Eigen::Matrix3d e = a.exp();
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
                    TransitionCase{2600.0, 0.005, 1e-4}, TransitionCase{5000.0, 0.9, 1e-3},
                    TransitionCase{100.0, 1.0, 1e-3}, TransitionCase{100.0, 2.0, 1e-3}));

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
