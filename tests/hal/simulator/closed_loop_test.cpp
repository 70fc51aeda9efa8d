// The stage of configs/stage/wafer_stage.yaml under its controller: suitability for experiments.
#include "tests/hal/simulator/closed_loop.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <random>
#include <string>
#include <unsupported/Eigen/FFT>
#include <vector>

#include "excitation/decompositions/decompositions.hpp"
#include "hal/simulator/simulated_stage.hpp"
#include "hal/stage/limited_stage.hpp"
#include "tests/hal/simulator/closed_loop_model.hpp"
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
  // T_y G K = -(T_y G T_u) C T_y: back to the axis through the pseudo-inverse of T_y.
  const Eigen::MatrixXcd forth = spec.controller.sensor_decoupling.cast<std::complex<double>>();
  const Eigen::MatrixXcd back =
      pseudo_inverse(spec.controller.sensor_decoupling).cast<std::complex<double>>();
  const auto loop_gain = [&](Eigen::Index axis, double f) {
    const Eigen::MatrixXcd G = sampled_response(modes, spec.info.delay_s, 1e4, f);
    const Eigen::MatrixXcd L = G * controller.response(f);
    const Eigen::MatrixXcd of_axes = forth * L;
    return std::abs((of_axes * back)(axis, axis));
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

/// One period of a random-phase multisine on the odd lines 1, 3, ..., 2 * lines - 1. hal must not use excitation, so
/// its tests have this copy.
Eigen::VectorXd odd_multisine(int period, int lines, double rms, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi);
  const double amplitude = rms * std::sqrt(2.0 / lines);
  std::vector<std::complex<double>> spectrum(period);
  for (int i = 0; i < lines; ++i) {
    const auto line = static_cast<std::size_t>(2 * i + 1);
    spectrum[line] = std::polar(0.5 * amplitude * period, phase(engine));
    spectrum[static_cast<std::size_t>(period) - line] = std::conj(spectrum[line]);
  }
  std::vector<std::complex<double>> samples;
  Eigen::FFT<double> fft;
  fft.inv(samples, spectrum);
  Eigen::VectorXd signal(period);
  for (int n = 0; n < period; ++n) signal[n] = samples[n].real();
  return signal;
}

Eigen::MatrixXd excite(std::initializer_list<int> axes) {
  Eigen::MatrixXd excitation = Eigen::MatrixXd::Zero(17, kPeriod);
  for (const int axis : axes)
    excitation.row(axis) =
        odd_multisine(kPeriod, kLines, kRms_n, static_cast<std::uint64_t>(axis)).transpose();
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

}  // namespace stageid::test_closed_loop
