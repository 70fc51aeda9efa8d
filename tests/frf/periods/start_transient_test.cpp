// A single ringing mode with light damping is named with an effective remedy; settled records of any noise cause no
// finding.
#include "frf/periods/start_transient.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <cstdlib>
#include <optional>

#include "frf/health/data_health.hpp"
#include "frf/health/transient_check.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/stages/sampled_loop.hpp"

namespace stageid::test_start_transient {

using test::LoopExperiment;
using test::MemoryLog;

constexpr double kSampleRateHz = 500.0;

enum class Colour { white, low, modal, mixed };

struct Setting {
  int channels = 2;
  int realizations = 4;
  int periods = 3;
  int transient_periods = 1;
  double decay_s = 0.2;  ///< of the mode at 93 Hz; the other two settle in 0.1 s
  double noise = 1e-3;
  Colour colour = Colour::white;
  std::uint64_t seed = 1;
};

/// Coloured: white noise through a pole of 0.99; modal: unrecorded white forces, which excite the modes for as long as
/// they ring.
MemoryLog simulate(const Setting& s) {
  test::RandomNumbers random(s.seed);
  const test::SampledPlant plant = test::sampled_plant(
      s.channels, s.channels,
      {{random.uniform(20.0, 60.0), 0.1}, {93.0, s.decay_s}, {random.uniform(120.0, 180.0), 0.1}},
      kSampleRateHz, 0.02);
  LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = 500, .axes = s.channels};
  x.lines = test::line_range(5, 199, 2);
  x.realizations = s.realizations;
  x.periods = s.periods;
  x.transient_periods = s.transient_periods;
  x.seed = s.seed;
  MemoryLog log = test::simulate_sampled_log(plant, x, s.colour == Colour::white ? s.noise : 0.0);
  if (s.colour == Colour::white) return log;
  for (LogSamples& record : log.records) {
    Eigen::VectorXd state = Eigen::VectorXd::Zero(plant.A.rows());
    Eigen::VectorXd slow = Eigen::VectorXd::Zero(s.channels);
    // The stationary noise of the closed loop, on top of the periodic part: it is linear.
    const Eigen::Index before = 20 * x.period_samples;
    for (Eigen::Index n = -before; n < record.sensors.rows(); ++n) {
      for (double& value : slow) value = 0.99 * value + 0.14 * random.normal();
      Eigen::VectorXd y = plant.C * state;
      if (s.colour != Colour::modal) y += s.noise * slow;
      if (s.colour == Colour::mixed)
        for (double& value : y) value += s.noise * random.normal();
      const Eigen::VectorXd u = -plant.K * y;
      if (n >= 0) {
        record.sensors.row(n) += y;
        record.actuators.row(n) += u;
      }
      Eigen::VectorXd force = u;
      if (s.colour != Colour::low)
        for (double& value : force) value += 20.0 * s.noise * random.normal();
      state = plant.A * state + plant.B * force;
    }
  }
  return log;
}

std::vector<Finding> unsettled(const MemoryLog& log, const FrfOptions& options = {}) {
  FrfOptions one = options;
  one.threads = 1;
  std::vector<Finding> found = check_health(read_health_record({&log}, one), std::nullopt);
  std::erase_if(found, [](const Finding& f) { return f.cause != Cause::unsettled; });
  return found;
}

TEST(StartTransient, ARingingModeIsNamedAndTheRemedySettlesIt) {
  int named = 0;
  int cured = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const MemoryLog log = simulate({.periods = 14, .decay_s = 0.5, .seed = seed});
    const std::vector<Finding> found = unsettled(log);
    if (found.size() != 1 || found[0].what.find("93") == std::string::npos) continue;
    EXPECT_EQ(found[0].severity, Severity::fault);
    EXPECT_NE(found[0].remedy.find("--method lpm"), std::string::npos);
    ++named;
    const std::string flag = "--transient-periods ";
    const std::size_t at = found[0].remedy.find(flag);
    ASSERT_NE(at, std::string::npos) << found[0].remedy;
    const int periods = std::atoi(found[0].remedy.c_str() + at + flag.size());
    EXPECT_GE(periods, 2);
    EXPECT_LE(periods, 9);  // two e-folds per period, starting at 1e6 standard deviations
    if (unsettled(log, {.transient_periods = periods}).empty()) ++cured;
  }
  EXPECT_GE(named, 19);
  EXPECT_GE(cured, 18);
}

// The fewest runs: their phases alone are no evidence, but the first period is.
TEST(StartTransient, IsFoundInFourRuns) {
  int named = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const std::vector<Finding> found = unsettled(
        simulate({.realizations = 2, .periods = 4, .decay_s = 0.45, .noise = 1e-6, .seed = seed}));
    named += found.size() == 1 && found[0].what.find("93") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(named, 19);
}

// The frf command's own data give the same.
TEST(StartTransient, TheEstimateGathersTheSame) {
  const MemoryLog log = simulate({.periods = 8, .decay_s = 0.5});
  const FrfAndHealth both = estimate_plant_frf_and_health({&log}, {.threads = 1});
  const HealthRecord alone = read_health_record({&log}, {.threads = 1});
  ASSERT_EQ(both.health.start.runs.size(), alone.start.runs.size());
  for (std::size_t e = 0; e < alone.start.runs.size(); ++e)
    EXPECT_TRUE(both.health.start.runs[e].along.isApprox(alone.start.runs[e].along, 1e-9)) << e;
  EXPECT_TRUE(
      estimate_plant_frf_and_health({&log}, {.method = FrfMethod::lpm}).health.start.runs.empty());
}

/// Runs of four periods and the one before them: noise, and change(p) times a random phase on `lines` of 60 lines,
/// in the middle or from the `first` on. The phase is the same in all periods of a run or `new_phases` in each.
template <typename Change>
std::vector<Finding> of_change(const Change& change, std::uint64_t seed, bool new_phases = false,
                               Eigen::Index lines = 5, std::optional<Eigen::Index> first = {},
                               int runs = 30) {
  test::RandomNumbers random(seed);
  StartEvidence evidence{.frequency_hz = Eigen::VectorXd::LinSpaced(60, 5.0, 64.0),
                         .runs = {},
                         .sensors = 2,
                         .transient_periods = 2,
                         .periods = 4};
  for (int run = 0; run < runs; ++run) {
    Eigen::MatrixXcd shape;
    const auto next = [&](int p) {
      if (p == 0 || new_phases) shape = test::circular_matrix(random, 2, lines);
      Eigen::MatrixXcd Z = test::circular_matrix(random, 2, 60);
      Z.middleCols(first.value_or((60 - lines) / 2), lines) += change(p) * shape;
      return Z;
    };
    StartRecorder recorder(next(0));
    for (int p = 1; p <= 4; ++p) recorder.take(next(p));
    evidence.runs.push_back(recorder.finish());
  }
  return check_start_transient(evidence);
}

struct Change {
  const char* name;
  double (*at)(int p);
  bool new_phases;
  Cause cause;
};

class ChangeOfPeriods : public testing::TestWithParam<Change> {};

// A loop that oscillates and comes to rest is not linear: no phase of one period follows from that of the last.
TEST_P(ChangeOfPeriods, IsNamed) {
  int named = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const std::vector<Finding> found = of_change(GetParam().at, seed, GetParam().new_phases);
    named += found.size() == 1 && found[0].cause == GetParam().cause;
    EXPECT_TRUE(GetParam().cause != Cause::drift || !any_fault(found)) << seed;
  }
  EXPECT_GE(named, 19);
}

INSTANTIATE_TEST_SUITE_P(
    StartTransient, ChangeOfPeriods,
    testing::Values(
        Change{"Steady", [](int p) { return 3.0 * p; }, false, Cause::drift},
        Change{"FastDecay", [](int p) { return 30.0 * std::pow(0.2, p); }, false, Cause::unsettled},
        Change{"Decay", [](int p) { return 30.0 * std::pow(0.5, p); }, false, Cause::unsettled},
        Change{"SlowDecay", [](int p) { return 30.0 * std::pow(0.7, p); }, false, Cause::unsettled},
        Change{"WithoutACommonRatio", [](int p) { return 30.0 * std::pow(0.5, p); }, true,
               Cause::limit_cycle}),
    [](const auto& change) { return change.param.name; });

// What remains of a strong start is found in few runs, and what noise does beside it is not.
TEST(StartTransient, AStrongStartIsTestedAgainstWhatTheRunsDifferBy) {
  const auto named = [](double left) {
    int out = 0;
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
      const auto change = [left](int p) { return p == 0 ? 40.0 : p == 1 ? 40.0 * left : 0.0; };
      if (!of_change(change, seed, false, 5, {}, 6).empty()) ++out;
    }
    return out;
  };
  EXPECT_GE(named(0.1), 38);
  EXPECT_LE(named(0.0), 2);
}

// What is gone after one used period scatters the periods as noise does, so the deviations contain it, however large it was.
TEST(StartTransient, AFastDecayShiftsByTheSameDeviationsHoweverStrong) {
  const auto figure = [](double start) {
    const std::vector<Finding> found =
        of_change([start](int p) { return start * std::pow(0.02, p); }, 1);
    return found.size() == 1 ? found[0].figure : "";
  };
  EXPECT_NE(figure(1e4), "");
  EXPECT_EQ(figure(1e4), figure(1e6));
}

// A mode that rings below the first line does no harm to the others, but a loop that oscillates there does.
TEST(StartTransient, AtAnEndOfTheLinesOnlyALimitCycleIsAFault) {
  for (const bool cycle : {false, true})
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      double turn = 0.0;
      const auto change = [&](int p) {
        if (p == 0 && cycle) turn = turn > 0.0 ? -0.95 : 0.95;  // of each run
        return std::polar(1e5 * std::pow(0.5, p), turn * p);
      };
      const std::vector<Finding> found = of_change(change, seed, false, 1, 0);
      const bool fault = std::ranges::any_of(found, [](const Finding& f) {
        return f.severity == Severity::fault && f.cause == Cause::limit_cycle;
      });
      EXPECT_EQ(fault, cycle) << (found.empty() ? "nothing" : found[0].what + found[0].figure);
    }
}

// A mode that rings for a thousand periods is rarer than one that drifts.
TEST(StartTransient, WhatHardlyDecaysIsADrift) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const std::vector<Finding> found =
        of_change([](int p) { return 3e5 * std::pow(0.99, p); }, seed, false, 60);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].cause, Cause::drift) << found[0].figure;
  }
}

class SettledNoise : public testing::TestWithParam<Colour> {};

// 60 logs of a colour with excited long-lived modes; not more findings below 1 in 200 than by chance:
// P(3 or more of 60 at 0.005) = 0.003.
TEST_P(SettledNoise, IsNotCalledRinging) {
  int alarms = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const int kind = static_cast<int>(seed % 3);
    const MemoryLog log = simulate({.channels = kind == 0 ? 3 : 2,
                                    .realizations = kind == 1 ? 1 : 4,
                                    .periods = kind == 2 ? 2 : 4,
                                    .transient_periods = 20,
                                    .decay_s = 1.0,
                                    .noise = 1e-3,
                                    .colour = GetParam(),
                                    .seed = seed});
    if (!unsettled(log).empty()) ++alarms;
  }
  EXPECT_LE(alarms, 2);
}

INSTANTIATE_TEST_SUITE_P(OfAnyColour, SettledNoise,
                         testing::Values(Colour::white, Colour::low, Colour::modal, Colour::mixed));

}  // namespace stageid::test_start_transient
