#include "estimation/loop/loop_margins.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "estimation/loop/loop_view.hpp"
#include "tests/estimation/loop_cases.hpp"

namespace stageid::test_loop_margins {

using test::FreeMass;
constexpr double kTwoPi = 2.0 * std::numbers::pi;
const Eigen::MatrixXd kUnknown;

TEST(LoopMargins, AreThoseOfAFreeMassWithAPdController) {
  const FreeMass stage;
  const MarginSet set = loop_margins(stage.model(), stage.controller(), kUnknown);
  ASSERT_EQ(set.loops.size(), 1U);
  const LoopMargins& m = set.loops[0];

  // The gain at which the characteristic polynomial has a root on the unit circle.
  ASSERT_TRUE(m.gain_db);
  EXPECT_GT(m.gain_db->value, 1.0);
  EXPECT_NEAR(stage.poles(std::pow(10.0, m.gain_db->value / 20.0)).cwiseAbs().maxCoeff(), 1.0,
              1e-9);
  EXPECT_FALSE(m.gain_reduction_db);  // a PD controller holds a mass at every lower gain

  ASSERT_TRUE(m.phase_deg);
  const std::complex<double> L = stage.loop_at(m.phase_deg->frequency_hz);
  EXPECT_NEAR(std::abs(L), 1.0, 1e-9);
  EXPECT_NEAR(m.phase_deg->value, 360.0 / kTwoPi * std::arg(-L), 1e-7);
  // The continuous loop crosses at w^2 = (kd^2 + sqrt(kd^4 + 4 m^2 kp^2)) / (2 m^2), and a sample delays it.
  const double m2 = std::pow(stage.mass_kg, 2);
  const double crossover_hz =
      std::sqrt((std::pow(stage.kd, 2) +
                 std::sqrt(std::pow(stage.kd, 4) + 4.0 * m2 * std::pow(stage.kp, 2))) /
                (2.0 * m2)) /
      kTwoPi;
  EXPECT_NEAR(m.phase_deg->frequency_hz, crossover_hz, 0.05 * crossover_hz);
  ASSERT_TRUE(m.delay_s);
  EXPECT_EQ(m.delay_s->frequency_hz, m.phase_deg->frequency_hz);
  EXPECT_NEAR(m.delay_s->value, std::arg(-L) / (kTwoPi * m.delay_s->frequency_hz), 1e-12);

  double least = HUGE_VAL;
  for (double f = 0.1; f < 500.0; f *= 1.0001)
    least = std::min(least, std::abs(1.0 + stage.loop_at(f)));
  EXPECT_NEAR(m.modulus.value, least, 1e-7);
  EXPECT_NEAR(set.distance.value, least, 1e-7);  // one loop: det(I + L) = 1 + L
  EXPECT_FALSE(m.modulus.deviation);
  EXPECT_FALSE(m.modulus.radius_95());
}

TEST(LoopMargins, ALowerLimitOfTheGainIsFound) {
  // A lag above the rate of the stage: the mass needs more gain than a tenth of this.
  FreeMass stage;
  LoopController controller = stage.controller();
  // An integrator beside it: K + ki T / (z - 1).
  const double ki = 4e5;
  StateSpace& K = controller.system;
  K.A = Eigen::MatrixXd{{0.0, 0.0}, {0.0, 1.0}};
  K.B = Eigen::MatrixXd{{1.0}, {1.0}};
  K.C = Eigen::MatrixXd{{K.C(0, 0), ki * stage.period_s}};
  const MarginSet set = loop_margins(stage.model(), controller, kUnknown);
  ASSERT_TRUE(set.loops[0].gain_reduction_db);
  const double gain = std::pow(10.0, -set.loops[0].gain_reduction_db->value / 20.0);
  const auto scaled = [&](double factor) {
    LoopController out = controller;
    out.system.C *= factor;
    out.system.D *= factor;
    return loop_poles(stage.model(), out);
  };
  EXPECT_TRUE(scaled(1.001 * gain).stable());
  EXPECT_FALSE(scaled(0.999 * gain).stable());
}

TEST(LoopMargins, ACrossingAtHalfTheSampleRateIsFound) {
  // P = (1 - p) / (z - p), p = e^(-T / tau), and K = k: the pole leaves the unit circle at -1, for k = (1 + p) / (1 - p).
  const FreeMass stage;
  AdditiveModel model = stage.model();
  Submodel lag;
  lag.denominator = {1.0, 2e-3};
  lag.numerator = {Eigen::MatrixXd::Ones(1, 1)};
  model.submodels = {lag};
  LoopController controller = stage.controller();
  controller.system = {Eigen::MatrixXd(0, 0),
                       Eigen::MatrixXd(0, 1),
                       Eigen::MatrixXd(1, 0),
                       Eigen::MatrixXd::Constant(1, 1, 0.7),
                       {}};
  const double p = std::exp(-stage.period_s / 2e-3);
  const Eigen::MatrixXd covariance =
      1e-8 * Eigen::MatrixXd::Identity(2, 2);  // of tau and of the gain
  const LoopMargins m = loop_margins(model, controller, covariance).loops[0];
  ASSERT_TRUE(m.gain_db);
  EXPECT_NEAR(m.gain_db->value, 20.0 * std::log10((1.0 + p) / ((1.0 - p) * 0.7)), 1e-9);
  EXPECT_EQ(m.gain_db->frequency_hz, 0.5 / stage.period_s);
  EXPECT_EQ(m.gain_db->frequency_deviation_hz, 0.0);
  // d ln g = (1/(1 + p) + 1/(1 - p)) p T / tau^2 dtau - dgain
  const double by_tau = 2.0 / (1.0 - p * p) * p * stage.period_s / 4e-6;
  EXPECT_NEAR(*m.gain_db->deviation, 20.0 / std::log(10.0) * 1e-4 * std::hypot(by_tau, 1.0), 1e-7);
  EXPECT_FALSE(m.phase_deg);  // |L| < 1 everywhere
}

TEST(LoopMargins, ACrossingOutsideTheFittedBandIsExtrapolated) {
  const FreeMass stage;
  AdditiveModel model = stage.model();
  model.fit.band_hz[0] = 1.0;
  model.fit.band_hz[1] = 50.0;
  const LoopMargins m = loop_margins(model, stage.controller(), kUnknown).loops[0];
  EXPECT_FALSE(m.phase_deg->extrapolated);
  EXPECT_TRUE(m.gain_db->extrapolated);
  EXPECT_GT(m.gain_db->frequency_hz, 50.0);
}

/// All values of the margins, in one order.
std::vector<Margin> list_of(const MarginSet& set) {
  std::vector<Margin> out = {set.distance};
  for (const LoopMargins& m : set.loops) {
    for (const std::optional<Margin>* one : {&m.gain_db, &m.phase_deg, &m.delay_s})
      out.push_back(one->value());
    out.push_back(m.modulus);
  }
  return out;
}

TEST(LoopMargins, HaveTheScatterOfModelsWithThisCovariance) {
  const AdditiveModel model = test::model_of({});
  const LoopController controller = test::tracked_controller();
  ASSERT_TRUE(loop_poles(model, controller).stable());
  const Eigen::Index delays = 1;
  const Eigen::VectorXd x = test::parameters_of(model, delays);
  test::RandomNumbers random(21);
  // Correlated errors of a thousandth.
  Eigen::MatrixXd R(x.size(), x.size());
  for (double& entry : R.reshaped()) entry = random.normal() / std::sqrt(double(x.size()));
  R = (1e-3 * x.cwiseAbs().asDiagonal() * R).eval();
  const std::vector<Margin> told = list_of(loop_margins(model, controller, R * R.transpose()));

  constexpr int kTrials = 300;
  Eigen::ArrayXd sum = Eigen::ArrayXd::Zero(std::ssize(told));
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::VectorXd noise = test::random_vector(random, x.size());
    const std::vector<Margin> other = list_of(
        loop_margins(test::with_parameters(model, delays, x + R * noise), controller, kUnknown));
    ASSERT_EQ(other.size(), told.size());
    for (std::size_t i = 0; i < told.size(); ++i)
      sum[i] += std::pow(other[i].value - told[i].value, 2);
  }
  for (std::size_t i = 0; i < told.size(); ++i) {
    const double scatter = std::sqrt(sum[i] / kTrials);
    ASSERT_TRUE(told[i].deviation);
    // Four standard deviations of a deviation from 300 trials.
    EXPECT_NEAR(scatter / *told[i].deviation, 1.0, 4.0 / std::sqrt(2.0 * kTrials))
        << "margin " << i;
    EXPECT_NEAR(*told[i].radius_95(), 1.959964 * *told[i].deviation, 1e-5 * *told[i].deviation);
  }
}

TEST(LoopView, DiscsContainTheCurvesOfModelsWithThisCovariance) {
  const AdditiveModel model = test::model_of({});
  const LoopController controller = test::tracked_controller();
  const Eigen::VectorXd x = test::parameters_of(model, 0);
  test::RandomNumbers random(22);
  const Eigen::VectorXd deviation = 1e-4 * x.cwiseAbs();
  const Eigen::MatrixXd covariance = deviation.cwiseAbs2().asDiagonal();
  const Eigen::VectorXd lines = Eigen::VectorXd::LinSpaced(40, 1.0, 300.0);  // more than one block
  const LoopView view = loop_view(model, controller, covariance, lines);
  ASSERT_TRUE(view.margins);
  int inside = 0;
  int all = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::VectorXd noise = test::random_vector(random, x.size());
    const AdditiveModel other = test::with_parameters(model, 0, x + deviation.asDiagonal() * noise);
    const auto points = loop_points(other, controller, lines, false);
    for (Eigen::Index k = 0; k < lines.size(); ++k) {
      const LoopPoint& point = points[k];
      for (Eigen::Index i = 0; i < 2; ++i, ++all)
        inside += std::abs(point.loop[i] - view.loop(i, k)) <= view.loop_radius(i, k) ? 1 : 0;
      inside += std::abs(point.determinant - view.determinant[k]) <= view.determinant_radius[k];
      ++all;
    }
  }
  // 200 independent trials of 120 dependent discs.
  EXPECT_NEAR(inside / double(all), 0.95, 0.015);
}

TEST(LoopView, AnUnstableLoopHasNoMargins) {
  FreeMass stage;
  LoopController controller = stage.controller();
  controller.system.C *= -1.0;
  controller.system.D *= -1.0;
  const LoopView view = loop_view(stage.model(), controller, kUnknown, Eigen::VectorXd{{10.0}});
  EXPECT_FALSE(view.margins);
  EXPECT_FALSE(view.poles.stable());
  EXPECT_EQ(view.loop_radius.size(), 0);
  EXPECT_LT(std::abs(view.loop(0, 0) + stage.loop_at(10.0)), 1e-9 * std::abs(view.loop(0, 0)));
}

}  // namespace stageid::test_loop_margins
