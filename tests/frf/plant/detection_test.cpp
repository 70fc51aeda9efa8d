// Unexcited lines: distortions of the plant, and the controller's feedback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "frf/plant/detection_average.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_detection {

using test::LoopExperiment;
using test::MemoryLog;
using testing::ElementsAre;

constexpr double kSampleRateHz = 200.0;
constexpr int kPeriod = 400;

test::SampledPlant stage() {
  return test::sampled_plant(2, 2, {{12.3, 0.1}, {37.0, 0.1}}, kSampleRateHz, 0.5);
}

/// Odd lines without every fourth of them.
LoopExperiment experiment(int realizations, int periods) {
  LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = kPeriod, .axes = 2};
  x.lines.clear();
  for (int line = 11; line <= 101; line += 2)
    if (line % 8 != 5) x.lines.push_back(line);
  x.realizations = realizations;
  x.periods = periods;
  x.transient_periods = 2;
  return x;
}

TEST(DetectionLines, AreThoseBetweenAndNearTheExcitedOnes) {
  EXPECT_THAT(detection_lines({3, 5, 9}), ElementsAre(4, 6, 7, 8));
  EXPECT_THAT(detection_lines({1, 20}), ElementsAre(2, 3, 4, 5, 16, 17, 18, 19));
  EXPECT_TRUE(detection_lines({4, 5, 6}).empty());
}

TEST(Detection, OnALinearPlantFalseAlarmsAreNominalInClosedLoop) {
  LoopExperiment x = experiment(2, 3);
  constexpr int kSeeds = 250;
  for (const auto scheme : {test::AxisScheme::single_axis, test::AxisScheme::orthogonal}) {
    x.scheme = scheme;
    double tests = 0.0;
    double at_5_percent = 0.0;
    double at_1_percent = 0.0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
      x.seed = static_cast<std::uint64_t>(seed);
      const MemoryLog log = test::simulate_sampled_log(stage(), x, 0.01);
      const FrfEstimate frf = estimate_plant_frf({&log}, {.threads = 1});
      for (const DetectedDistortion* kind : {&frf.nonlinearity.even, &frf.nonlinearity.odd}) {
        tests += static_cast<double>(kind->p_value.size());
        at_5_percent += static_cast<double>((kind->p_value.array() < 0.05).count());
        at_1_percent += static_cast<double>((kind->p_value.array() < 0.01).count());
      }
    }
    // At least 2000 tests (orthogonal: one group): standard deviations 0.5 and 0.22 %, a little more because outputs
    // and groups share noise estimates. The bounds are three and a half of them.
    ASSERT_GE(tests, 2000.0);
    EXPECT_NEAR(at_5_percent / tests, 0.05, 0.02);
    EXPECT_NEAR(at_1_percent / tests, 0.01, 0.009);
  }
}

/// y = linear + distortion(linear): the distortion of a noiseless period, and its spectrum.
Eigen::MatrixXcd distortion_spectrum(const LogSamples& record, double cubic,
                                     const Eigen::VectorXi& lines) {
  RealDft dft(kPeriod);
  Eigen::MatrixXcd spectrum(record.sensors.cols(), lines.size());
  for (Eigen::Index i = 0; i < record.sensors.cols(); ++i) {
    for (Eigen::Index n = 0; n < kPeriod; ++n) {
      const double y = record.sensors(record.sensors.rows() - kPeriod + n, i);
      double linear = y;  // Newton on linear + cubic linear^3 = y
      for (int step = 0; step < 20; ++step)
        linear -=
            (linear + cubic * std::pow(linear, 3) - y) / (1.0 + 3.0 * cubic * linear * linear);
      dft.input()[static_cast<std::size_t>(n)] = y - linear;
    }
    const auto transformed = dft.forward();
    for (Eigen::Index d = 0; d < lines.size(); ++d)
      spectrum(i, d) = transformed[static_cast<std::size_t>(lines[d])] / double{kPeriod};
  }
  return spectrum;
}

TEST(Detection, FeedbackIsTakenOutOfTheLevel) {
  LoopExperiment x = experiment(1, 2);
  x.transient_periods = 8;
  test::SampledPlant plant = stage();
  plant.K *= 12.0;
  const double cubic = 0.02;
  const MemoryLog log = test::simulate_sampled_log(plant, x, 1e-9, cubic);
  const FrfEstimate frf = estimate_plant_frf({&log});
  const DetectionLines& lines = frf.detection;
  ASSERT_THAT(lines.groups, ElementsAre("a1", "a2"));
  double corrected = 0.0;
  double as_measured = 0.0;
  double truth_sum = 0.0;
  RealDft dft(kPeriod);
  for (Eigen::Index run = 0; run < 2; ++run) {
    const LogSamples& record = log.records[static_cast<std::size_t>(run)];
    const Eigen::MatrixXcd truth = distortion_spectrum(record, cubic, lines.line);
    for (Eigen::Index i = 0; i < 2; ++i) {
      for (Eigen::Index n = 0; n < kPeriod; ++n)
        dft.input()[static_cast<std::size_t>(n)] =
            record.sensors(record.sensors.rows() - kPeriod + n, i);
      const auto Y = dft.forward();
      for (Eigen::Index d = 0; d < lines.line.size(); ++d) {
        if (lines.line[d] % 2 == 0) continue;
        const double amplitude = std::abs(truth(i, d));
        const double y = std::abs(Y[static_cast<std::size_t>(lines.line[d])]) / kPeriod;
        corrected += std::pow(std::sqrt(lines.power(i + 2 * run, d)) - amplitude, 2);
        as_measured += std::pow(y - amplitude, 2);
        truth_sum += amplitude * amplitude;
      }
    }
  }
  // The remainder is due to G between lines that are four apart, and to the distortion in G itself.
  EXPECT_LT(std::sqrt(corrected / truth_sum), 0.1) << as_measured / truth_sum;
  EXPECT_GT(std::sqrt(as_measured / truth_sum), 0.3);
}

// A cubic sensor, 1e-3 of the signal: it distorts odd lines, but not even ones.
TEST(Detection, ACubicTermAtMinus60DecibelIsFoundOnOddLines) {
  const LoopExperiment x = experiment(4, 4);
  const MemoryLog linear = test::simulate_sampled_log(stage(), x, 1e-5);
  const Eigen::MatrixXd& y = linear.records[0].sensors;
  const double rms =
      std::sqrt(y.colwise().squaredNorm().maxCoeff() / static_cast<double>(y.rows()));
  const double cubic = 1e-3 / (std::sqrt(15.0) * rms * rms);  // rms of y^3 is sqrt(15) rms^3
  const MemoryLog quiet = test::simulate_sampled_log(stage(), x, 1e-5 * rms);
  EXPECT_GT(estimate_plant_frf({&quiet}).nonlinearity.p_value.minCoeff(), 1e-4);
  const MemoryLog log = test::simulate_sampled_log(stage(), x, 1e-5 * rms, cubic);
  const NonlinearityTest found = estimate_plant_frf({&log}).nonlinearity;
  EXPECT_LT(found.distortion.maxCoeff(), 0.1);
  EXPECT_LT(found.p_value.rowwise().minCoeff().maxCoeff(), 1e-6);
  EXPECT_LT(found.odd.p_value.rowwise().minCoeff().minCoeff(), 1e-6);
  EXPECT_GT(found.even.p_value.minCoeff(), 1e-4);
  // A part of -60 dB, spread over the excited lines and three times as many others.
  EXPECT_GT(found.odd.level.maxCoeff(), 1e-4);
  EXPECT_LT(found.odd.level.maxCoeff(), 1e-2);
}

TEST(Detection, WithoutTwoRealizationsOrPeriodsNothingIsTested) {
  const MemoryLog one = test::simulate_sampled_log(stage(), experiment(1, 3), 0.01);
  const FrfEstimate frf = estimate_plant_frf({&one});
  EXPECT_EQ(frf.nonlinearity.band_hz.size(), 0);
  EXPECT_GT(frf.detection.line.size(), 0);
  const MemoryLog short_log = test::simulate_sampled_log(stage(), experiment(2, 1), 0.01);
  const FrfEstimate single = estimate_plant_frf({&short_log});
  EXPECT_EQ(single.nonlinearity.band_hz.size(), 0);
  EXPECT_EQ(single.detection.line.size(), 0);
  const MemoryLog both = test::simulate_sampled_log(stage(), experiment(2, 2), 0.01);
  const FrfEstimate lpm = estimate_plant_frf({&both}, {.method = FrfMethod::lpm});
  EXPECT_EQ(lpm.nonlinearity.band_hz.size(), 0);
  EXPECT_THROW(nonlinearity_test(lpm), std::invalid_argument);
}

TEST(Detection, SelectedOutputsKeepTheirRows) {
  const MemoryLog log = test::simulate_sampled_log(stage(), experiment(2, 2), 0.01);
  const FrfEstimate whole = estimate_plant_frf({&log});
  const FrfEstimate part = select_channels(whole, {"a2"}, {"z2"});
  check(part);
  EXPECT_EQ(part.nonlinearity.p_value, whole.nonlinearity.p_value.row(3));
  EXPECT_EQ(part.detection.noise, whole.detection.noise.row(1));
  ASSERT_EQ(part.nonlinearity.even.p_value.rows(), 2);  // both groups
  EXPECT_EQ(part.nonlinearity.even.p_value.row(1), whole.nonlinearity.even.p_value.row(3));
}

}  // namespace stageid::test_detection
