#include "excitation/multisine/signal_peaks.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "excitation/plan/experiment_plan.hpp"

namespace stageid::test_signal_peaks {

using Eigen::Index;

constexpr double kRate_hz = 1000.0;
constexpr int kPeriod = 500;

FrequencyGrid grid_of(LineSelection lines) {
  return FrequencyGrid::band(kRate_hz, kPeriod,
                             {.low_hz = 2.0, .high_hz = 200.0, .selection = lines});
}

ExperimentPlan plan_of(const FrequencyGrid& grid) {
  ExperimentSpec spec;
  spec.scheme = ExcitationScheme::orthogonal_dft;
  spec.axes = {{"a", 1.0, {}}, {"b", 2.0, {}}};
  spec.seed = 4;
  return {grid, spec};
}

/// x[n] = a x[n-1] + r_a[n] + r_b[n], whose transfer is 1 / (1 - a z^-1).
BoundedSignal low_pass(const FrequencyGrid& grid, double a) {
  BoundedSignal signal;
  signal.transfer.resize(2, grid.size());
  for (Index k = 0; k < grid.size(); ++k)
    signal.transfer.col(k).setConstant(
        1.0 / (1.0 - a * std::polar(1.0, -grid.omega_rad_s()[k] / kRate_hz)));
  return signal;
}

Eigen::VectorXd simulated(const Eigen::MatrixXd& r, double a, int periods) {
  Eigen::VectorXd x(periods * r.rows());
  double state = 0.0;
  for (Index n = 0; n < x.size(); ++n) {
    state = a * state + r.row(n % r.rows()).sum();
    x[n] = state;
  }
  return x;
}

TEST(SignalPeaks, SteadyStateIsThatOfASimulation) {
  const FrequencyGrid grid = grid_of(LineSelection::odd);
  const ExperimentPlan plan = plan_of(grid);
  constexpr double kPole = 0.9;
  const Eigen::VectorXd x = simulated(plan.excitation({0, 1}), kPole, 4).tail(kPeriod);
  const BoundedSignal signal = low_pass(grid, kPole);
  const SignalPeak peak = SignalPredictor(grid).predict({signal}, plan.spectrum({0, 1})).at(0);
  const double sampled = x.cwiseAbs().maxCoeff();
  EXPECT_GE(peak.steady, sampled);
  EXPECT_LT(peak.steady, 1.15 * sampled);  // between the samples, and 8 % of the bound
  EXPECT_NEAR(peak.rms, std::sqrt(x.squaredNorm() / kPeriod), 1e-9 * peak.rms);
}

// The bound holds on a grid 40 times as fine.
TEST(SignalPeaks, NothingBetweenTheSamplesIsLarger) {
  const FrequencyGrid grid = grid_of(LineSelection::all);
  const ExperimentPlan plan = plan_of(grid);
  BoundedSignal signal = low_pass(grid, 0.0);
  for (const SignalKind kind : {SignalKind::value, SignalKind::derivative}) {
    signal.kind = kind;
    const Eigen::MatrixXcd R = plan.spectrum({0, 0});
    double largest = 0.0;
    for (int i = 0; i < 40 * kPeriod; ++i) {
      const double t = i / (40.0 * kRate_hz);
      double x = 0.0;
      for (Index k = 0; k < grid.size(); ++k) {
        const double omega = grid.omega_rad_s()[k];
        const std::complex<double> factor =
            kind == SignalKind::value ? 1.0 : std::complex<double>(0.0, omega);
        x += 2.0 * (factor * R.col(k).sum() * std::polar(1.0, omega * t)).real();
      }
      largest = std::max(largest, std::abs(x));
    }
    const SignalPeak peak = SignalPredictor(grid).predict({signal}, R).at(0);
    EXPECT_GE(peak.steady, largest);
    EXPECT_LT(peak.steady, 1.09 * largest);
  }
}

// The transient of a slow pole exceeds the steady state; the first period equals that of a simulation.
TEST(SignalPeaks, TheFirstPeriodFromRestIsThatOfASimulation) {
  for (const LineSelection lines : {LineSelection::all, LineSelection::odd}) {
    const FrequencyGrid grid = grid_of(lines);
    const ExperimentPlan plan = plan_of(grid);
    constexpr double kPole = 0.95;  // 20 samples; odd lines resolve 250
    const Eigen::MatrixXd r = plan.excitation({0, 0});
    BoundedSignal signal = low_pass(grid, kPole);
    const Eigen::VectorXd x = simulated(r, kPole, 1);
    Eigen::VectorXd change = x;
    change.tail(kPeriod - 1) -= x.head(kPeriod - 1);
    SignalPredictor predictor(grid);
    const double value = x.cwiseAbs().maxCoeff();
    // Linear between the lines: h times a triangle's spectrum, (h (1 - (t / 0.25 s)^2 / ...)): 2 %. Below the first
    // line, nothing is known.
    EXPECT_NEAR(predictor.predict({signal}, plan.spectrum({0, 0})).at(0).from_rest, value,
                0.05 * value);
    signal.kind = SignalKind::difference;
    const double slew = kRate_hz * change.cwiseAbs().maxCoeff();
    EXPECT_NEAR(predictor.predict({signal}, plan.spectrum({0, 0})).at(0).from_rest, slew,
                0.05 * slew);
  }
}

/// x[n] = a x[n-1] + b x[n-2] + r[n], poles 0.98 exp(+-j 2 pi 10 Hz / fs): its transfer is
/// 1 / (1 - a z^-1 - b z^-2).
struct Swinging {
  const double a = 2.0 * 0.98 * std::cos(2.0 * std::numbers::pi * 10.0 / kRate_hz);
  const double b = -0.98 * 0.98;

  std::complex<double> transfer(double f_hz) const {
    const auto z = std::polar(1.0, -2.0 * std::numbers::pi * f_hz / kRate_hz);
    return 1.0 / (1.0 - a * z - b * z * z);
  }
  /// Largest value of the first period from rest.
  double largest(const Eigen::VectorXd& r) const {
    double largest = 0.0;
    double x[2] = {0.0, 0.0};
    for (const double sample : r) {
      const double now = a * x[0] + b * x[1] + sample;
      x[1] = x[0];
      x[0] = now;
      largest = std::max(largest, std::abs(now));
    }
    return largest;
  }
};

// A loop that oscillates at 10 Hz, which a band from 50 Hz on does not contain. Started at rest, it moves up to three
// times as far as the band predicts; the transfer below the band predicts it correctly.
TEST(SignalPeaks, BelowTheBandTheFirstPeriodFromRestIsThatOfASimulationToo) {
  const FrequencyGrid grid =
      FrequencyGrid::band(kRate_hz, kPeriod, {.low_hz = 50.0, .high_hz = 200.0});
  ExperimentSpec spec = plan_of(grid).spec();
  spec.realizations = 4;
  const ExperimentPlan plan(grid, spec);
  const Swinging loop;
  BoundedSignal blind;
  blind.transfer.resize(2, grid.size());
  for (Index k = 0; k < grid.size(); ++k)
    blind.transfer.col(k).setConstant(loop.transfer(grid.frequency_hz()[k]));
  BoundedSignal seeing = blind;
  const Eigen::VectorXd below_hz = below_band_hz(grid);
  ASSERT_EQ(below_hz.size(), 2 * grid.lines().front() - 1);
  seeing.below_band.resize(2, below_hz.size());
  for (Index i = 0; i < below_hz.size(); ++i) {
    EXPECT_DOUBLE_EQ(below_hz[i], 0.5 * static_cast<double>(i + 1) * grid.resolution_hz());
    seeing.below_band.col(i).setConstant(loop.transfer(below_hz[i]));
  }
  BoundedSignal careful = seeing;
  careful.rest_margin = 0.1;
  BoundedSignal doubtful = seeing;
  doubtful.below_band_doubt = 0.5;
  BoundedSignal below = seeing;  // only the part below the band
  below.transfer.setZero();
  SignalPredictor predictor(grid);
  double least = 1.0;
  for (const RunId run : plan.runs()) {
    const double value = loop.largest(plan.excitation(run).rowwise().sum());
    const auto peaks =
        predictor.predict({blind, seeing, careful, doubtful, below}, plan.spectrum(run));
    least = std::min(least, peaks[0].peak() / value);
    EXPECT_NEAR(peaks[1].from_rest, value, 0.01 * value);
    EXPECT_DOUBLE_EQ(peaks[2].from_rest, 1.1 * peaks[1].from_rest);
    // Interpolation extends part of it to between the first two lines.
    EXPECT_NEAR(peaks[3].from_rest - peaks[1].from_rest, 0.5 * peaks[4].from_rest,
                0.06 * peaks[4].from_rest);
  }
  EXPECT_LT(least, 0.6);
}

// For a sine, the window's mean square ripples: m = A^2/2 (1 + |1 / (1 + j 2 omega tau)|).
TEST(SignalPeaks, TheWindowedRmsOfASineIsTheKnownOne) {
  constexpr int kSamples = 20000;
  constexpr double kTau_s = 0.05;
  const double omega = 2.0 * std::numbers::pi * 2.0;
  Eigen::VectorXd x(kSamples);
  for (int n = 0; n < kSamples; ++n) x[n] = 3.0 * std::sin(omega * n / kRate_hz);
  const double ripple = 1.0 / std::abs(std::complex<double>(1.0, 2.0 * omega * kTau_s));
  // Sampling of the window: 1 / (fs tau) = 2 %, half of it in the root, of the ripple only.
  EXPECT_NEAR(windowed_rms(x, kRate_hz, kTau_s), std::sqrt(4.5 * (1.0 + ripple)), 0.02);
  EXPECT_NEAR(windowed_rms(x, kRate_hz, 0.0), std::sqrt(4.5), 1e-12);
}

TEST(SignalPeaks, APeriodThatCannotBeDoubledIsRefused) {
  const FrequencyGrid grid(1e6, 2'000'000'000, {1});
  EXPECT_THROW(SignalPredictor{grid}, std::invalid_argument);
}

}  // namespace stageid::test_signal_peaks
