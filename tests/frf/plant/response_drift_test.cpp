// A mode whose frequency changes during the measurement.
#include "frf/plant/response_drift.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_response_drift {

using Eigen::Index;
using test::MemoryLog;

struct Spec {
  std::uint64_t seed = 1;
  int realizations = 1;
  double drift = 0.0;  ///< of the first mode's frequency, over the whole measurement
  double noise = 1e-4;
  double cubic = 0.0;
  double settled = 1.0;  ///< transient periods
  double decay_s = 0.06;
};

double first_hz(const Spec& spec) {
  test::ComplexNoise random(spec.seed + 100);
  return 60.0 + 60.0 * random.uniform();
}

/// The loop of simulate_sampled_log() with a first mode whose frequency changes linearly from the first sample to the
/// last.
MemoryLog drifting_log(const Spec& spec) {
  test::LoopExperiment x{.sample_rate_hz = 2000.0, .period_samples = 2000, .axes = 2};
  x.lines = test::line_range(3, 601, 2);
  x.realizations = spec.realizations;
  x.periods = 4;
  x.transient_periods = static_cast<int>(spec.settled);
  x.seed = spec.seed;
  const double low_hz = first_hz(spec);
  const auto plant_of = [&](double frequency_hz) {
    return test::sampled_plant(3, 2, {{frequency_hz, spec.decay_s}, {2.1 * low_hz, 0.05}},
                               x.sample_rate_hz, 0.05);
  };
  const int runs = x.axes * x.realizations;
  MemoryLog log = test::simulate_sampled_log(plant_of(low_hz), x, 0.0);
  test::ComplexNoise random(spec.seed + 7);
  for (int run = 0; run < runs; ++run) {
    LogSamples& record = log.records[static_cast<std::size_t>(run)];
    const Eigen::MatrixXd& period = log.excitation_periods[static_cast<std::size_t>(run)];
    Eigen::VectorXd state = Eigen::VectorXd::Zero(4);
    const Index rows = record.sensors.rows();
    test::SampledPlant plant;
    for (Index n = 0; n < rows; ++n) {
      if (n % 100 == 0) {
        const double share = (run + static_cast<double>(n) / static_cast<double>(rows)) / runs;
        plant = plant_of(low_hz * (1.0 + spec.drift * (share - 0.5)));
      }
      Eigen::VectorXd y = plant.C * state;
      y.array() += spec.cubic * y.array().cube();
      for (double& value : y) value += spec.noise * test::real_gaussian(random);
      const Eigen::VectorXd u = period.row(n % x.period_samples).transpose() - plant.K * y;
      record.sensors.row(n) = y;
      record.actuators.row(n) = u;
      state = plant.A * state + plant.B * u;
    }
  }
  return log;
}

/// The change that a finding reports, from the drift over the whole measurement: that within one run, or that from the
/// middle of the first realization to the middle of the last.
double reported_change(const Spec& spec, const ModeDrift& drift) {
  if (drift.within_runs) return spec.drift / (2.0 * spec.realizations);
  return spec.drift * (spec.realizations - 1.0) / spec.realizations;
}

TEST(ResponseDrift, AModeThatMovesIsNamedWithItsFrequencyAndByHowMuch) {
  int named = 0;
  int logs = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed)
    for (const int realizations : {1, 3})
      for (const double drift : {5e-4, -2e-3}) {
        const Spec spec{seed, realizations, drift, 1e-5};
        const MemoryLog log = drifting_log(spec);
        const HealthRecord record = estimate_plant_frf_and_health({&log}).health;
        ++logs;
        if (!record.drift) continue;
        EXPECT_NEAR(record.drift->frequency_hz, first_hz(spec), 6.0) << seed;
        const double expected = reported_change(spec, *record.drift);
        EXPECT_NEAR(record.drift->change, expected,
                    std::max(0.35 * std::abs(expected), 4.0 * record.drift->deviation))
            << seed << " " << realizations;
        ++named;
        EXPECT_EQ(record.drift->in_total, realizations > 1);
      }
  EXPECT_GE(named, logs * 95 / 100) << logs;
}

// A resonance with a single line inside its width.
TEST(ResponseDrift, ANarrowModeIsNamedAsWell) {
  int named = 0;
  int within = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Spec spec{seed, 2, 5e-4, 1e-6, 0.0, 2.0, 0.2};
    const MemoryLog log = drifting_log(spec);
    const HealthRecord record = estimate_plant_frf_and_health({&log}).health;
    if (!record.drift) continue;
    ++named;
    EXPECT_NEAR(record.drift->frequency_hz, first_hz(spec), 6.0) << seed;
    within += std::abs(record.drift->change - reported_change(spec, *record.drift)) <
                      4.0 * record.drift->deviation
                  ? 1
                  : 0;
  }
  EXPECT_GE(named, 11);
  EXPECT_GE(within, 10);
}

TEST(ResponseDrift, IsNotFoundWithoutOne) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    for (const int realizations : {1, 3})
      for (const double noise : {1e-6, 1e-3}) {
        const MemoryLog log = drifting_log({seed, realizations, 0.0, noise});
        EXPECT_FALSE(estimate_plant_frf_and_health({&log}).health.drift)
            << seed << " " << realizations << " " << noise;
      }
}

TEST(ResponseDrift, NeitherATransientNorADistortionIsTakenForOne) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const MemoryLog transient = drifting_log({seed, 2, 0.0, 1e-6, 0.0, 0.0});
    EXPECT_FALSE(estimate_plant_frf_and_health({&transient}).health.drift) << seed;
    const MemoryLog cubic = drifting_log({seed, 3, 0.0, 1e-6, 1e-2});
    EXPECT_FALSE(estimate_plant_frf_and_health({&cubic}).health.drift) << seed;
  }
}

// Beyond three standard deviations the response misleads whoever fits it.
TEST(ResponseDrift, ADriftThatMisleadsIsAFault) {
  ModeDrift drift;
  drift.frequency_hz = 90.0;
  drift.change = 5e-4;
  drift.bias = 2.9;
  EXPECT_EQ(to_finding(drift).severity, Severity::doubt);
  drift.bias = 3.1;
  EXPECT_EQ(to_finding(drift).severity, Severity::fault);
  EXPECT_NE(to_finding(drift).what.find("near 90 Hz a mode moves by +0.05 %"), std::string::npos)
      << to_finding(drift).what;
}

}  // namespace stageid::test_response_drift
