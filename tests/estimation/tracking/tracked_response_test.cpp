#include "estimation/tracking/tracked_response.hpp"

#include <gtest/gtest.h>

#include <complex>
#include <numbers>
#include <string>

#include "tests/estimation/tracked_stage.hpp"

namespace stageid::test_tracked_response {

using test::model_of;
using test::StageProperties;
using test::tracked_lines_hz;

const std::array<double, 2> kBand = {20.0, 315.0};

TrackedResponse response_of(const AdditiveModel& model) {
  return {model, tracked_parameters(model, kBand), tracked_lines_hz()};
}

/// Changes of all parameters, none of them small.
Eigen::VectorXd changes(const TrackedResponse& response) {
  test::RandomNumbers random(4);
  Eigen::VectorXd x(response.size());
  for (Eigen::Index p = 0; p < x.size(); ++p) {
    const bool delay = response.parameters()[p].kind == TrackedKind::delay;
    x[p] = (delay ? 2e-5 : 0.1) * random.uniform(0.5, 1.0) *
           (!delay && random.integer(0, 1) == 0 ? -1.0 : 1.0);
  }
  return x;
}

AdditiveModel with_delays_by_channel() {
  AdditiveModel model = model_of({});
  model.input_delay_s = Eigen::VectorXd{{1e-4, 1.3e-4, 0.2e-4}};
  model.output_delay_s = Eigen::VectorXd{{2.9e-4, 2.1e-4}};
  return model;
}

TEST(TrackedParameters, AreThoseOfDeterminedModesInTheBandAndOfAllChannels) {
  AdditiveModel model = model_of({});
  model.submodels[2].verdict = ModeVerdict::weak;
  model.submodels[3].verdict = ModeVerdict::determined;
  std::vector<std::string> names;
  for (const TrackedParameter& p : tracked_parameters(model, {100.0, 250.0}))
    names.push_back(describe(p, model));
  EXPECT_EQ(names, (std::vector<std::string>{
                       "frequency of the mode at 188 Hz", "damping ratio of the mode at 188 Hz",
                       "gain of sensor 'y1'", "gain of sensor 'y2'", "gain of actuator 'a1'",
                       "gain of actuator 'a2'", "gain of actuator 'a3'", "delay"}));
}

TEST(TrackedResponse, AMovedModeKeepsItsMassNormalizedNumerators) {
  const StageProperties stage;
  const AdditiveModel model = model_of(stage);
  for (std::size_t i = 0; i < 4; ++i) {
    const Submodel mode = moved(model.submodels[i + 1], 0.2, -0.4);
    const auto N = test::mode_numerator(i);
    const double omega = 2.0 * std::numbers::pi * stage.frequency_hz[i] * 1.2;
    const double zeta = stage.damping_ratio[i] * 0.6;
    for (const double hz : {10.0, 80.0, 300.0}) {
      const std::complex<double> s(0.0, 2.0 * std::numbers::pi * hz);
      const Eigen::MatrixXcd expected =
          (N[0] + s * N[1]) / (s * s + 2.0 * zeta * omega * s + omega * omega);
      Eigen::MatrixXcd value = mode.numerator[0].cast<std::complex<double>>();
      if (mode.numerator.size() > 1) value += s * mode.numerator[1];
      value /= 1.0 + mode.denominator[1] * s + mode.denominator[2] * s * s;
      EXPECT_LT((value - expected).norm(), 1e-13 * expected.norm()) << i << " at " << hz << " Hz";
    }
  }
}

TEST(TrackedResponse, IsThatOfTheChangedStageBehindTheExactHold) {
  for (const HoldModel hold : {HoldModel::exact, HoldModel::none}) {
    AdditiveModel model = model_of({});
    model.hold = hold;
    const TrackedResponse response = response_of(model);
    const Eigen::VectorXd x = changes(response);
    StageProperties stage;
    ASSERT_EQ(x.size(), 14);
    for (std::size_t i = 0; i < 4; ++i) {
      stage.frequency_hz[i] *= 1.0 + x[i];
      stage.damping_ratio[i] *= 1.0 + x[static_cast<Eigen::Index>(i) + 4];
    }
    stage.sensor_gain += x.segment(8, 2);
    stage.actuator_gain += x.segment(10, 3);
    stage.delay_s += x[13];
    const Eigen::MatrixXcd expected =
        test::reference_response(model_of(stage), tracked_lines_hz(), HoldModel::exact);
    EXPECT_LT((response.at(x) - expected).norm(), 1e-10 * expected.norm()) << to_string(hold);
  }
}

TEST(TrackedResponse, IsTheSumOfItsSubmodels) {
  const TrackedResponse response = response_of(with_delays_by_channel());
  const Eigen::VectorXd x = changes(response);
  Eigen::MatrixXcd sum = Eigen::MatrixXcd::Zero(6, tracked_lines_hz().size());
  for (Eigen::Index i = 0; i < std::ssize(response.model().submodels); ++i)
    sum += response.at(x, i);
  EXPECT_LT((sum - response.at(x)).norm(), 1e-13 * sum.norm());
}

void expect_derivatives(const AdditiveModel& model, const std::string& what) {
  const TrackedResponse response = response_of(model);
  const Eigen::VectorXd x = changes(response);
  test::RandomNumbers random(5);
  const Eigen::MatrixXcd U = test::circular_matrix(random, 3, tracked_lines_hz().size());
  const Eigen::MatrixXcd derivatives = response.derivatives(x, U);
  ASSERT_EQ(derivatives.cols(), x.size());
  for (Eigen::Index p = 0; p < x.size(); ++p) {
    const bool delay = response.parameters()[p].kind == TrackedKind::delay;
    const double scale = delay ? 1.0 / test::kTrackedRateHz : 1.0;
    const auto slope = [&](double step) -> Eigen::MatrixXcd {
      const Eigen::VectorXd direction = Eigen::VectorXd::Unit(x.size(), p) * (step * scale);
      return (TrackedResponse::outputs(response.at(x + direction), U) -
              TrackedResponse::outputs(response.at(x - direction), U)) /
             (2.0 * step * scale);
    };
    // Extrapolated central differences. A mode that moves by 1e-5 moves by 5e-4 of its width: the remainder is the
    // fourth power of that, and rounding 1e-15 / 1e-5.
    const Eigen::MatrixXcd expected = (4.0 * slope(1e-5) - slope(2e-5)) / 3.0;
    EXPECT_GT(expected.norm(), 0.0);
    EXPECT_LT((derivatives.col(p) - expected.reshaped()).norm(), 3e-9 * expected.norm())
        << describe(response.parameters()[p], model) << ", " << what;
  }
}

TEST(TrackedResponse, HasTheDerivativesOfFiniteDifferences) {
  for (const HoldModel hold : {HoldModel::exact, HoldModel::none}) {
    AdditiveModel model = model_of({});
    model.hold = hold;
    expect_derivatives(model, "one delay");
    model = with_delays_by_channel();
    model.hold = hold;
    expect_derivatives(model, "delays by channel");
  }
}

}  // namespace stageid::test_tracked_response
