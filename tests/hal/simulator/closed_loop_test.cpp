// The stage of configs/stage/wafer_stage.yaml under its controller: suitability for experiments.
#include "tests/hal/simulator/closed_loop.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "excitation/decompositions/decompositions.hpp"
#include "hal/simulator/simulated_stage.hpp"
#include "hal/stage/limited_stage.hpp"
#include "tests/hal/simulator/closed_loop_model.hpp"
#include "tests/hal/simulator/multisine_signal.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_closed_loop {

constexpr int kPeriod = 40000;  // 4 s at 10 kHz
constexpr int kLines = 4000;    // odd ones, 0.25 to 1999.75 Hz
constexpr double kRms_n = 2.0;

TEST(ClosedLoop, SimulationFollowsTheModelOfTheWholeLoop) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  const test::DenseModel model = test::closed_loop_model(spec);
  SimulatedStage stage(spec.info, spec.plant, spec.simulation);
  test::ClosedLoop loop(stage, spec.controller);
  loop.start(1);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(model.a.rows());
  Eigen::VectorXd r = Eigen::VectorXd::Zero(17);
  double largest = 0.0;
  double error = 0.0;
  for (int n = 0; n < 400; ++n) {
    r[n % 17] = std::cos(0.3 * n * n);
    ASSERT_EQ(loop.step(r), Outcome::ok);
    x = model.a * x + model.b * r;
    const Eigen::VectorXd y = model.c * x;
    largest = std::max(largest, y.norm());
    error = std::max(error, (loop.y() - y).norm());
  }
  EXPECT_LT(error, 1e-10 * largest);
}

// sigma_max of the output sensitivity (I - G K)^-1, all channels in metres, over all frequencies:
// a logarithmic grid, and finely through every resonance.
TEST(ClosedLoop, HasASensitivityPeakBelowTwoAndAHalf) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  const auto modes = plant_modes(spec.info, spec.plant);
  const MotionController controller(spec.controller);
  std::vector<double> grid;
  for (int i = 0; i <= 1200; ++i) grid.push_back(0.02 * std::pow(4999.0 / 0.02, i / 1200.0));
  for (const PlantMode& mode : modes)
    for (int i = -20; i <= 20; ++i)
      grid.push_back(mode.natural_frequency_hz * (1.0 + 0.25 * i * mode.damping_ratio));
  double peak = 0.0;
  for (const double f : grid) {
    if (f <= 0.0) continue;
    const Eigen::MatrixXcd G = sampled_response(modes, spec.info.delay_s, 1e4, f);
    const Eigen::MatrixXcd loop = Eigen::MatrixXcd::Identity(7, 7) - G * controller.response(f);
    // sigma_max(S) = 1 / sigma_min(I - G K)
    peak = std::max(peak, 1.0 / svd(loop, 0).singularValues().minCoeff());
  }
  RecordProperty("sensitivity_peak", std::to_string(peak));
  EXPECT_LT(peak, 2.5);
  EXPECT_GT(peak, 1.0);
}

TEST(ClosedLoop, CrossesOverBetweenThirtyAndSixtyHertzOutOfPlane) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  const auto modes = plant_modes(spec.info, spec.plant);
  const MotionController controller(spec.controller);
  const auto loop_gain = [&](Eigen::Index axis, double f) {
    const Eigen::MatrixXcd G = sampled_response(modes, spec.info.delay_s, 1e4, f);
    const Eigen::MatrixXcd L = spec.controller.sensor_decoupling * G * controller.response(f);
    // T_y G K = -(T_y G T_u) C T_y: back to the axis through the pseudo-inverse of T_y.
    const Eigen::MatrixXd back = pseudo_inverse(spec.controller.sensor_decoupling);
    return std::abs((L * back)(axis, axis));
  };
  for (const Eigen::Index axis : {2, 3, 4}) {
    EXPECT_GT(loop_gain(axis, 30.0), 1.0);
    EXPECT_LT(loop_gain(axis, 60.0), 1.0);
  }
}

struct Record {
  Eigen::MatrixXd u, y;  // channels x samples
  bool all_ok = true;
};

// `periods` of the excitation (17 x period) on a limited stage; only the last ones are kept.
Record run(const test::SimulatedSpec& spec, const Eigen::MatrixXd& excitation, int periods,
           int kept) {
  LimitedStage stage(test::simulated(spec), spec.limits);
  test::ClosedLoop loop(stage, spec.controller);
  const auto period = static_cast<int>(excitation.cols());
  Record record{Eigen::MatrixXd(17, kept * period), Eigen::MatrixXd(7, kept * period)};
  loop.start(1);
  const int skipped = (periods - kept) * period;
  for (int n = 0; n < periods * period; ++n) {
    if (n >= skipped) record.y.col(n - skipped) = loop.y();
    record.all_ok = loop.step(excitation.col(n % period)) == Outcome::ok && record.all_ok;
    if (n >= skipped) record.u.col(n - skipped) = loop.u();
  }
  return record;
}

Eigen::MatrixXd excite(std::initializer_list<int> axes) {
  Eigen::MatrixXd excitation = Eigen::MatrixXd::Zero(17, kPeriod);
  for (const int axis : axes)
    excitation.row(axis) =
        test::odd_multisine(kPeriod, kLines, kRms_n, static_cast<std::uint64_t>(axis)).transpose();
  return excitation;
}

// Every pole, those of suspension, integrators and flexible modes included, must have decayed in 4 s.
TEST(ClosedLoop, IsPeriodicAfterOnePeriod) {
  const Record record = run(test::silent_wafer_stage_spec(), excite({0}), 3, 2);
  EXPECT_TRUE(record.all_ok);
  const double change = (record.y.leftCols(kPeriod) - record.y.rightCols(kPeriod)).norm();
  EXPECT_LT(change, 1e-9 * record.y.leftCols(kPeriod).norm());
}

// All thirteen axes at once, 2 N rms each, with noise: all limits are far away.
TEST(ClosedLoop, KeepsTheDefaultExperimentFarFromItsLimits) {
  const test::SimulatedSpec spec = test::wafer_stage_spec();
  for (const Eigen::MatrixXd& excitation :
       {excite({0}), excite({6}), excite({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12})}) {
    const Record record = run(spec, excitation, 1, 1);
    EXPECT_TRUE(record.all_ok);
    EXPECT_LT((record.u.cwiseAbs().rowwise().maxCoeff().array() / spec.limits.actuator_n.array())
                  .maxCoeff(),
              0.5);
    EXPECT_LT(
        (record.y.cwiseAbs().rowwise().maxCoeff().array() / spec.limits.position_window_m.array())
            .maxCoeff(),
        0.5);
  }
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// Relative standard deviation of FRF entries from three periods on one axis. Let dY and dU be the differences between a
// noisy and a noise-free run. dE = dY - G dU is then the open-loop noise at the sensors, and the error of the estimate
// is dE / U (three periods: over sqrt 3).
struct FrfNoise : testing::Test {
  FrfNoise() {
    const Eigen::MatrixXd excitation = excite({0});
    const Record silent = run(test::silent_wafer_stage_spec(), excitation, 2, 1);
    const Record noisy = run(test::wafer_stage_spec(), excitation, 2, 1);
    U_ = spectra(silent.u);
    dU_ = spectra(noisy.u) - U_;
    dY_ = spectra(noisy.y) - spectra(silent.y);
  }
  static Eigen::MatrixXcd spectra(const Eigen::MatrixXd& signals) {
    Eigen::MatrixXcd lines(signals.rows(), 2 * kLines);
    for (Eigen::Index i = 0; i < signals.rows(); ++i)
      lines.row(i) = test::spectrum(signals.row(i).transpose()).head(2 * kLines).transpose();
    return lines;
  }
  // |dG| / |G| of the entries (z sensors, z1) at an odd line.
  std::vector<double> relative_error(Eigen::Index line) const {
    const Eigen::MatrixXcd G =
        sampled_response(modes_, 130e-6, 1e4, 0.25 * static_cast<double>(line));
    const Eigen::VectorXcd dE = dY_.col(line) - G * dU_.col(line);
    std::vector<double> errors;
    for (Eigen::Index i = 0; i < test::kZSensors; ++i)
      errors.push_back(std::abs(dE[i] / U_(0, line) / G(i, 0)) / std::sqrt(3.0));
    return errors;
  }
  double median_between(double low_hz, double high_hz) const {
    std::vector<double> all;
    for (Eigen::Index line = 1; line < 2 * kLines; line += 2) {
      const double f = 0.25 * static_cast<double>(line);
      if (f < low_hz || f > high_hz) continue;
      for (const double e : relative_error(line)) all.push_back(e);
    }
    return median(all);
  }

  test::SimulatedSpec spec_ = test::wafer_stage_spec();
  std::vector<PlantMode> modes_ = plant_modes(spec_.info, spec_.plant);
  Eigen::MatrixXcd U_, dU_, dY_;
};

TEST_F(FrfNoise, IsAtThePerMilleToPercentLevelInMidBand) {
  struct Band {
    double low_hz, high_hz, least, most;
  };
  for (const Band& band : {Band{20.0, 100.0, 1e-4, 2e-2}, Band{100.0, 300.0, 5e-4, 1e-2},
                           Band{300.0, 1000.0, 1e-3, 1e-2}, Band{1000.0, 2000.0, 1e-3, 5e-2}}) {
    const double level = median_between(band.low_hz, band.high_hz);
    RecordProperty("median_relative_error_to_" + std::to_string(std::lround(band.high_hz)) + "_hz",
                   std::to_string(level));
    EXPECT_GT(level, band.least) << "from " << band.low_hz << " Hz";
    EXPECT_LT(level, band.most) << "from " << band.low_hz << " Hz";
  }
}

}  // namespace stageid::test_closed_loop
