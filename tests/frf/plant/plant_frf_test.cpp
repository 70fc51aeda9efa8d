#include "frf/plant/plant_frf.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "excitation/decompositions/decompositions.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_plant_frf {

using test::AxisScheme;
using test::LoopExperiment;
using test::MemoryLog;

// Rounding only. A DFT rounds relative to its largest line, and the plant rolls off by 75^2 = 6e3
// over the lines: eps * 6e3 = 1e-12 on the smallest. Margin for sums and the inversion: 100.
constexpr double kRounding = 1e-10;

/// Largest relative error over the lines of |G - truth| (Frobenius).
double largest_error(const FrfEstimate& frf, const test::Transfer& plant) {
  double largest = 0.0;
  const Eigen::VectorXd omega = frf.omega_rad_s();
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd truth = plant(omega[k]);
    largest = std::max(largest, (frf.at(k) - truth).norm() / truth.norm());
  }
  return largest;
}

MemoryLog log_of(const LoopExperiment& x) { return test::simulate_log(test::small_stage(), x); }

void expect_exact(const FrfEstimate& frf) {
  EXPECT_LT(largest_error(frf, test::small_stage().plant), kRounding);
}

TEST(PlantFrf, IndirectMethodRecoversTheExactPlantInClosedLoop) {
  const LoopExperiment x{.realizations = 2, .periods = 3};
  const MemoryLog log = log_of(x);

  const FrfEstimate frf = estimate_plant_frf({&log});

  expect_exact(frf);
  EXPECT_EQ(frf.inputs, log.log_info.actuators);
  EXPECT_EQ(frf.outputs, log.log_info.sensors);
  ASSERT_EQ(frf.lines(), 10);
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    EXPECT_DOUBLE_EQ(frf.frequency_hz[k], 4.0 * x.lines[static_cast<std::size_t>(k)]);
  }
  EXPECT_EQ(frf.realizations, 2);
  EXPECT_EQ(frf.periods, 3);
  EXPECT_EQ(frf.experiments, 3);
  EXPECT_EQ(frf.noise_dof, 2.0 * 3.0 * 2.0);  // M E (P - 1)
  EXPECT_EQ(frf.total_dof, 1.0);
  EXPECT_EQ(frf.hold, Hold::zoh);
  EXPECT_EQ(frf.compensated, Compensation::none);
  EXPECT_EQ(frf.sample_rate_hz, 1000.0);
  EXPECT_NO_THROW(check(frf));
}

// If y / r were equal too, the test above would prove nothing.
TEST(PlantFrf, TheDirectRatioWouldBeBiasedByTheLoop) {
  const LoopExperiment x;
  const test::ClosedLoop loop = test::small_stage();
  const Eigen::MatrixXcd G = loop.plant(test::omega_of(x, 2));
  const Eigen::MatrixXcd C = loop.controller(test::omega_of(x, 2));
  const Eigen::MatrixXcd Y_by_R = G * inverse(Eigen::MatrixXcd::Identity(3, 3) + C * G);
  EXPECT_GT((Y_by_R - G).norm(), 0.3 * G.norm());
}

// The classical estimate sum Y U^H (sum U U^H)^-1 is biased towards -1/C by noise in the loop; the indirect one is not.
// One input, one output, as much noise as excitation.
TEST(PlantFrf, NoiseInTheLoopDoesNotBiasIt) {
  const test::ClosedLoop loop{[](double omega) {
                                return Eigen::MatrixXcd::Constant(
                                    1, 1, 300.0 / std::complex<double>(1.0, omega));
                              },
                              [](double) { return Eigen::MatrixXcd::Constant(1, 1, 2.0); }};
  LoopExperiment x{.lines = {2, 5}, .axes = 1, .periods = 3000, .seed = 5};
  x.noise_factor = Eigen::MatrixXcd::Constant(1, 1, 1.0);
  const MemoryLog log = test::simulate_log(loop, x);

  const FrfEstimate frf = estimate_plant_frf({&log});

  RealDft dft(x.period_samples);
  for (Eigen::Index k = 0; k < 2; ++k) {
    std::complex<double> cross = 0.0;
    double power = 0.0;
    for (int p = 1; p <= x.periods; ++p) {
      const Eigen::Index n = x.period_samples;
      const int line = x.lines[static_cast<std::size_t>(k)];
      const auto coefficient = [&](const Eigen::MatrixXd& samples) {
        std::copy_n(samples.col(0).data() + p * n, n, dft.input().begin());
        return dft.forward()[static_cast<std::size_t>(line)];
      };
      const std::complex<double> y = coefficient(log.records[0].sensors);
      const std::complex<double> u = coefficient(log.records[0].actuators);
      cross += y * std::conj(u);
      power += std::norm(u);
    }
    const std::complex<double> truth = loop.plant(test::omega_of(x, k))(0, 0);
    const double deviation = std::sqrt(frf.noise_variance(0, k));
    EXPECT_LT(std::abs(frf.at(k)(0, 0) - truth), 4.0 * deviation);  // exp(-16): negligible
    EXPECT_GT(std::abs(cross / power - truth), 20.0 * deviation);
  }
}

TEST(PlantFrf, APeriodOfTransientSpoilsTheEstimateUnlessItIsDropped) {
  const MemoryLog log = log_of({.periods = 2});
  expect_exact(estimate_plant_frf({&log}));
  const FrfOptions all{.transient_periods = 0, .periods = PeriodChoice::unmarked};
  EXPECT_GT(largest_error(estimate_plant_frf({&log}, all), test::small_stage().plant), 1e-3);
}

TEST(PlantFrf, MoreTransientPeriodsThanTheLogSaysMayBeDropped) {
  MemoryLog log = log_of({.periods = 3, .transient_periods = 2});
  log.log_info.transient_periods = 1;
  const FrfOptions all{.periods = PeriodChoice::unmarked};
  EXPECT_GT(largest_error(estimate_plant_frf({&log}, all), test::small_stage().plant), 1e-3);
  const FrfEstimate frf = estimate_plant_frf({&log}, {.transient_periods = 2});
  expect_exact(frf);
  EXPECT_EQ(frf.periods, 3);
}

// More experiments than axes are used by least squares.
TEST(PlantFrf, OtherSchemesAndNumbersOfExperimentsGiveTheSamePlant) {
  for (const int experiments : {3, 7})
    for (const AxisScheme scheme :
         {AxisScheme::random, AxisScheme::single_axis, AxisScheme::orthogonal}) {
      const MemoryLog log =
          log_of({.experiments = experiments, .realizations = 2, .scheme = scheme, .seed = 4});
      const FrfEstimate frf = estimate_plant_frf({&log});
      expect_exact(frf);
      EXPECT_EQ(frf.experiments, experiments);
    }
}

TEST(PlantFrf, OddPeriodLengthsReachTheLineBelowHalfTheSampleRate) {
  LoopExperiment x{.period_samples = 127, .lines = {1, 30, 63}};
  const MemoryLog log = log_of(x);
  const FrfEstimate frf = estimate_plant_frf({&log});
  ASSERT_EQ(frf.lines(), 3);
  expect_exact(frf);
}

TEST(PlantFrf, PermutedInputsPermuteColumnsAndPermutedOutputsRows) {
  const MemoryLog log = log_of({.realizations = 2});
  const FrfEstimate straight = estimate_plant_frf({&log});
  const FrfEstimate turned =
      estimate_plant_frf({&log}, {.inputs = {"a3", "a1", "a2"}, .outputs = {"z2", "z1"}});
  EXPECT_EQ(turned.inputs.names, (std::vector<std::string>{"a3", "a1", "a2"}));
  for (Eigen::Index k = 0; k < straight.lines(); ++k) {
    const Eigen::MatrixXcd G = straight.at(k);
    Eigen::MatrixXcd expected(2, 3);
    expected << G(1, 2), G(1, 0), G(1, 1), G(0, 2), G(0, 0), G(0, 1);
    EXPECT_LT((turned.at(k) - expected).norm(), kRounding * G.norm());
  }
}

TEST(PlantFrf, AScaledSensorScalesItsRowAndAScaledActuatorItsColumn) {
  LoopExperiment x{.realizations = 2, .periods = 3, .seed = 8};
  x.noise_factor = 1e-3 * Eigen::MatrixXcd::Identity(2, 2);
  MemoryLog log = log_of(x);
  const FrfEstimate before = estimate_plant_frf({&log});
  for (LogSamples& record : log.records) {
    record.sensors.col(1) *= 8.0;
    record.actuators.col(2) *= 4.0;
  }
  const FrfEstimate after = estimate_plant_frf({&log});
  for (Eigen::Index c = 0; c < 6; ++c) {
    const double scale = (c % 2 == 1 ? 8.0 : 1.0) / (c / 2 == 2 ? 4.0 : 1.0);
    for (Eigen::Index k = 0; k < before.lines(); ++k) {
      EXPECT_LT(std::abs(after.response(c, k) - scale * before.response(c, k)),
                kRounding * std::abs(after.response(c, k)));
      EXPECT_NEAR(after.noise_variance(c, k) / (scale * scale * before.noise_variance(c, k)), 1.0,
                  1e-9);
      EXPECT_NEAR(after.total_variance(c, k) / (scale * scale * before.total_variance(c, k)), 1.0,
                  1e-9);
    }
  }
}

TEST(PlantFrf, AStrongerExcitationChangesNothing) {
  MemoryLog log = log_of({});
  const FrfEstimate before = estimate_plant_frf({&log});
  for (std::size_t i = 0; i < log.records.size(); ++i) {
    log.records[i].sensors *= 3.0;
    log.records[i].actuators *= 3.0;
    log.excitation_periods[i] *= 3.0;
  }
  const FrfEstimate after = estimate_plant_frf({&log});
  EXPECT_LT((after.response - before.response).norm(), kRounding * before.response.norm());
}

TEST(PlantFrf, SomeInputsAreColumnsOfTheWholeEstimate) {
  const MemoryLog log = log_of({.realizations = 2, .periods = 3});
  const FrfEstimate all = estimate_plant_frf({&log});
  const FrfEstimate some = estimate_plant_frf({&log}, {.inputs = {"a3", "a1"}});
  ASSERT_EQ(some.n_inputs(), 2);
  for (Eigen::Index k = 0; k < all.lines(); ++k) {
    EXPECT_EQ(some.at(k).col(0), all.at(k).col(2));
    EXPECT_EQ(some.at(k).col(1), all.at(k).col(0));
  }
  EXPECT_TRUE(some.excluded_channels.empty());  // a2 is part of the estimate
}

TEST(PlantFrf, ExcitationNamesOtherThanActuatorsMeanAllActuators) {
  MemoryLog log = log_of({});
  log.log_info.excitation = test::channels("d", 3, "N");
  const FrfEstimate frf = estimate_plant_frf({&log});
  EXPECT_EQ(frf.inputs, log.log_info.actuators);
  expect_exact(frf);
}

// Two of three actuators are excited; the controller moves the third. The estimate is then the plant with the third
// loop closed, and the power of the third is reported.
TEST(PlantFrf, TheInputsAreTheExcitedActuatorsAndTheOthersPowerIsReported) {
  const LoopExperiment x{.axes = 2};
  const test::ClosedLoop loop = test::small_stage();
  const MemoryLog log = test::simulate_log(loop, x);

  const FrfEstimate frf = estimate_plant_frf({&log});

  EXPECT_EQ(frf.inputs.names, (std::vector<std::string>{"a1", "a2"}));
  ASSERT_EQ(frf.excluded_channels, std::vector<std::string>{"a3"});
  double power = 0.0;
  double excluded = 0.0;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd G = loop.plant(test::omega_of(x, k));
    const Eigen::MatrixXcd C = loop.controller(test::omega_of(x, k));
    const Eigen::MatrixXcd S = inverse(Eigen::MatrixXcd::Identity(3, 3) + C * G);
    power += S.topLeftCorner(2, 2).squaredNorm();
    excluded += S.bottomLeftCorner(1, 2).squaredNorm();
    const Eigen::MatrixXcd biased = G * S.leftCols(2) * inverse(S.topLeftCorner(2, 2));
    EXPECT_LT((frf.at(k) - biased).norm(), kRounding * biased.norm());
  }
  EXPECT_NEAR(frf.excluded_power[0], excluded / power, 1e-9 * excluded / power);
  EXPECT_GT(frf.excluded_power[0], 1e-3);
}

TEST(PlantFrf, OnlyTheRealizationsAskedForAreUsed) {
  MemoryLog log = log_of({.realizations = 3});
  for (std::size_t run = 3; run < 6; ++run)
    log.records[run].sensors *= 2.0;  // corrupts realization 1
  EXPECT_GT(largest_error(estimate_plant_frf({&log}), test::small_stage().plant), 0.1);
  const FrfEstimate frf = estimate_plant_frf({&log}, {.realizations = {2, 0}});
  expect_exact(frf);
  EXPECT_EQ(frf.realizations, 2);
}

TEST(PlantFrf, OfSeveralCompleteRunsTheLastCounts) {
  const test::ClosedLoop loop = test::small_stage();
  MemoryLog log = test::simulate_log(loop, {});
  log.append(0, 1, log.excitation_periods[1], log.records[1]);  // the repetition is valid
  log.records[1].sensors.setConstant(7.0);                      // the first attempt was not
  EXPECT_LT(largest_error(estimate_plant_frf({&log}), loop.plant), kRounding);
}

TEST(PlantFrf, RealizationsMayBeSpreadOverLogs) {
  const MemoryLog both = log_of({.realizations = 2});
  MemoryLog first = both;
  MemoryLog second = both;
  first.log_runs[3].complete = first.log_runs[4].complete = first.log_runs[5].complete = false;
  second.log_runs[0].complete = second.log_runs[1].complete = second.log_runs[2].complete = false;
  const FrfEstimate apart = estimate_plant_frf({&second, &first});
  EXPECT_EQ(apart.realizations, 2);
  EXPECT_EQ(apart.response, estimate_plant_frf({&both}).response);
}

TEST(PlantFrf, OneCleanPeriodGivesNoNoiseVariance) {
  MemoryLog log = log_of({.realizations = 2, .periods = 2});
  for (LogSamples& record : log.records) record.marked[700] = 1;
  log.records[1].marked[17] = 1;  // in the transient
  const FrfEstimate frf = estimate_plant_frf({&log});
  EXPECT_EQ(frf.periods, 1);
  EXPECT_EQ(frf.noise_variance.size(), 0);
  EXPECT_EQ(frf.residual_covariance.size(), 0);
  EXPECT_EQ(frf.noise_dof, 0.0);
  EXPECT_EQ(frf.total_variance.cols(), 10);
  EXPECT_NO_THROW(check(frf));
}

// Open loop, flat excitation: U = R, so cond(U) is that of the excitation: 1 for single axes of
// equal level, and 5 if one axis is five times as strong.
TEST(PlantFrf, TheConditionOfTheInputsIsReported) {
  MemoryLog log = test::simulate_log(test::open_loop(), {.realizations = 2});
  EXPECT_LT((estimate_plant_frf({&log}).input_condition.array() - 1.0).abs().maxCoeff(), 1e-9);
  log.excitation_periods[3] *= 5.0;  // realization 1, axis 0; the largest is reported
  log.records[3].actuators *= 5.0;
  log.records[3].sensors *= 5.0;
  EXPECT_LT((estimate_plant_frf({&log}).input_condition.array() - 5.0).abs().maxCoeff(), 1e-9);
}

TEST(PlantFrf, ProgressReachesTheTotal) {
  const MemoryLog log = log_of({.realizations = 2, .periods = 3});
  double last = 0.0;
  double end = 0.0;
  int calls = 0;
  FrfOptions options;
  options.threads = 2;
  options.progress = [&](double done, double total) {
    EXPECT_GT(done, last);
    last = done;
    end = total;
    ++calls;
  };
  estimate_plant_frf({&log}, options);
  EXPECT_EQ(last, end);
  EXPECT_EQ(end, 2.0 * 3.0 * 3.0 * 250.0 * 5.0 * 8.0);  // bytes of the used periods
  EXPECT_EQ(calls, 18);
}

}  // namespace stageid::test_plant_frf
