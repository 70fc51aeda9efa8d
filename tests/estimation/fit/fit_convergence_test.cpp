// Convergence of a fit and its message: the first-order condition by separate code, the convex start against a QR
// factorization, three methods, every status, any number of threads.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "estimation/fit/fit_additive_model.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "tests/estimation/noisy_stage.hpp"
#include "tests/support/models/expect_same_fit.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test_fit_convergence {

using test::DenseProblem;
using test::moved;
using test::noisy_stage;

/// A fit and the first-order condition at its end, by separate code.
std::pair<FitResult, double> fit_and_condition(FitMethod method, HoldModel hold,
                                               const FitOptions& tolerances) {
  DenseProblem problem = noisy_stage(hold, 0.03);
  FitOptions options = tolerances;
  options.hold = hold;
  options.method = method;
  options.delay = hold == HoldModel::none ? DelayModel::fixed : DelayModel::estimate;
  FitResult fit =
      fit_additive_model(test::frf_of(problem), moved(problem.model, 1.002, 1.5), options);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_NEAR(fit.model.fit.cost,
              test::reference_cost(fit.model, problem.frequency_hz, hold, problem.G, problem.W),
              1e-11 * fit.model.fit.cost);
  problem.model = fit.model;
  const double condition =
      test::first_order_condition(problem, options.delay == DelayModel::estimate);
  // It decides something: a ten-thousandth of a pole away it does not hold.
  for (Submodel& s : problem.model.submodels)
    if (s.is_mode()) s.denominator[2] *= 1.0001;
  EXPECT_GT(test::first_order_condition(problem, false), 1e-4);
  return {std::move(fit), condition};
}

TEST(FitConvergence, ThePapersFirstOrderConditionHolds) {
  for (const FitMethod method : {FitMethod::riv, FitMethod::gn})
    for (const HoldModel hold : {HoldModel::none, HoldModel::exact}) {
      const auto [fit, condition] = fit_and_condition(method, hold, {});
      // Within d standard deviations of the stationary point the residual and a parameter's effect
      // have a cosine below d / sqrt(values): 1e-4 / sqrt(2400).
      EXPECT_LT(condition, 2.1e-6)
          << to_string(method) << ", hold " << to_string(hold) << ": " << fit.message();
      FitOptions strict;
      strict.deviation_tolerance = 0.0;
      const auto [end, last] = fit_and_condition(method, hold, strict);
      // As small as requested if that ended the fit; else the cost is flat to rounding, and the gradient is the square
      // root of rounding.
      EXPECT_LT(last, end.status() == FitStatus::gradient_small ? 1e-8 : 1e-6)
          << to_string(method) << ", hold " << to_string(hold) << ": " << end.message();
    }
}

TEST(FitConvergence, ATrialThatCannotReachItsCostIsGivenUp) {
  const DenseProblem problem = noisy_stage(HoldModel::none, 0.03);
  const FrfEstimate frf = test::frf_of(problem);
  const AdditiveModel start = moved(problem.model, 1.002, 1.5);
  FitOptions options;
  options.uncertainty = false;
  const FitResult whole = fit_additive_model(frf, start, options);
  ASSERT_GT(whole.cost.size(), 3U);

  options.worthwhile_cost = 1.01 * whole.model.fit.cost;
  const FitResult same = fit_additive_model(frf, start, options);
  EXPECT_EQ(same.status(), whole.status());
  EXPECT_EQ(same.cost, whole.cost);

  options.worthwhile_cost = 0.9 * whole.model.fit.cost;
  const FitResult given_up = fit_additive_model(frf, start, options);
  EXPECT_EQ(given_up.status(), FitStatus::iteration_limit);
  EXPECT_LT(given_up.cost.size(), whole.cost.size());
}

TEST(FitConvergence, TheConvexStartIsTheWeightedLeastSquaresSolution) {
  for (const double apart : {1.1, 1.003}) {  // the second pair is inside its half-power width
    DenseProblem problem = noisy_stage(HoldModel::none, 0.05);
    AdditiveModel start = moved(problem.model, 1.004, 1.4);
    const std::vector<double> close =
        test::mode_coefficients(start.submodels[2].natural_frequency_hz() * apart, 0.011);
    start.submodels[3].denominator = {1.0, close[0], close[1]};
    FitOptions options;
    options.max_iterations = 0;
    options.uncertainty = false;
    const FitResult fit = fit_additive_model(test::frf_of(problem), start, options);

    const Eigen::Index N = problem.frequency_hz.size();
    const auto K = static_cast<Eigen::Index>(start.submodels.size());
    double cost = 0.0;
    for (Eigen::Index c = 0; c < problem.channels(); ++c) {
      Eigen::MatrixXd columns(2 * N, K);
      Eigen::VectorXd data(2 * N);
      for (Eigen::Index k = 0; k < N; ++k) {
        const double root = std::sqrt(problem.W(c, k));
        const std::complex<double> s(0.0, 2.0 * std::numbers::pi * problem.frequency_hz[k]);
        for (Eigen::Index i = 0; i < K; ++i) {
          const Submodel& sub = start.submodels[static_cast<std::size_t>(i)];
          const std::complex<double> value =
              root *
              test::evaluate(
                  {sub.integrators, {sub.denominator.begin() + 1, sub.denominator.end()}, 0}, s);
          columns(k, i) = value.real();
          columns(N + k, i) = value.imag();
        }
        data[k] = root * problem.G(c, k).real();
        data[N + k] = root * problem.G(c, k).imag();
      }
      const Eigen::VectorXd scale = columns.colwise().norm().cwiseInverse();
      const auto qr = pivoted_qr(columns * scale.asDiagonal());
      const Eigen::VectorXd B = scale.cwiseProduct(least_squares(qr, data));
      cost += (data - columns * B).squaredNorm() / (2.0 * static_cast<double>(N));
      const Eigen::VectorXd pivots = qr.matrixR().diagonal().cwiseAbs();
      const double condition = pivots.maxCoeff() / pivots.minCoeff();
      // Normal equations with a refinement: eps times the square of the condition at worst.
      const double tolerance = 100.0 * 2.2e-16 * condition * condition;
      for (Eigen::Index i = 0; i < K; ++i) {
        const double found =
            fit.model.submodels[static_cast<std::size_t>(i)].numerator[0].reshaped()[c];
        EXPECT_NEAR(found * columns.col(i).norm(), B[i] * columns.col(i).norm(),
                    tolerance * data.norm())
            << "channel " << c << ", submodel " << i << ", condition " << condition;
      }
    }
    EXPECT_NEAR(fit.model.fit.cost, cost, 1e-11 * cost);
  }
}

TEST(FitConvergence, RivAndGaussNewtonReachOneMinimumAndSkAnotherPoint) {
  const DenseProblem problem = noisy_stage(HoldModel::none, 0.2, 3);
  const auto fit_by = [&](FitMethod method) {
    FitOptions options;
    options.method = method;
    options.max_iterations = 500;
    return fit_additive_model(test::frf_of(problem), moved(problem.model, 1.002, 1.3), options);
  };
  const FitResult riv = fit_by(FitMethod::riv);
  const FitResult gn = fit_by(FitMethod::gn);
  const FitResult sk = fit_by(FitMethod::sk);
  EXPECT_TRUE(riv.trustworthy()) << riv.message();
  EXPECT_TRUE(gn.trustworthy()) << gn.message();
  EXPECT_NEAR(riv.model.fit.cost, gn.model.fit.cost, 1e-11 * gn.model.fit.cost);
  double bias = 0.0;
  for (std::size_t i = 1; i < riv.model.submodels.size(); ++i) {
    const double f = gn.model.submodels[i].natural_frequency_hz();
    const double deviation = *gn.model.submodels[i].natural_frequency_std_hz;
    // The cost is flat to 1e-13 within 1e-6 of a standard deviation; margin 1000.
    EXPECT_NEAR(riv.model.submodels[i].natural_frequency_hz(), f, 1e-3 * deviation);
    bias = std::max(bias, std::abs(sk.model.submodels[i].natural_frequency_hz() - f) / deviation);
  }
  EXPECT_GT(sk.model.fit.cost, gn.model.fit.cost * (1.0 + 1e-5));
  EXPECT_GT(bias, 0.01);
}

TEST(FitConvergence, TheCostNeverRises) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
    for (const FitMethod method : {FitMethod::riv, FitMethod::gn}) {
      const DenseProblem problem = noisy_stage(HoldModel::exact, 0.1, seed);
      FitOptions options =
          test::fit_options(Weighting::relative, HoldModel::exact, DelayModel::estimate);
      options.method = method;
      std::vector<double> seen;
      options.progress = [&](int iteration, double cost) {
        EXPECT_EQ(iteration, static_cast<int>(seen.size()) + 1);
        seen.push_back(cost);
      };
      const FitResult fit =
          fit_additive_model(test::frf_of(problem), moved(problem.model, 1.01, 4.0), options);
      ASSERT_EQ(fit.cost.size(), seen.size() + 1);
      for (std::size_t i = 1; i < fit.cost.size(); ++i) {
        EXPECT_LE(fit.cost[i], fit.cost[i - 1]);
        EXPECT_EQ(fit.cost[i], seen[i - 1]);
      }
      EXPECT_EQ(fit.model.fit.cost, fit.cost.back());
      EXPECT_EQ(fit.model.cost_history, fit.cost);
      EXPECT_EQ(fit.model.fit.iterations, static_cast<int>(seen.size()));
    }
}

TEST(FitStatus, IsWhatEndedTheFit) {
  const DenseProblem problem = noisy_stage(HoldModel::none, 0.03);
  struct End {
    void (*set)(FitOptions&);
    AdditiveModel start;
    FitStatus status;
  };
  const AdditiveModel near = moved(problem.model, 1.002, 1.5);
  for (const End& end :
       {End{[](FitOptions& o) { o.max_iterations = 1; }, moved(problem.model, 1.01, 3.0),
            FitStatus::iteration_limit},
        {[](FitOptions& o) { o.gradient_tolerance = 1e-5; }, near, FitStatus::gradient_small},
        {[](FitOptions& o) { o.gradient_tolerance = o.deviation_tolerance = 0.0; }, near,
         FitStatus::step_small}}) {
    FitOptions options;
    end.set(options);
    const FitResult fit = fit_additive_model(test::frf_of(problem), end.start, options);
    EXPECT_EQ(fit.status(), end.status) << fit.message();
    EXPECT_EQ(fit.trustworthy(), end.status != FitStatus::iteration_limit);
    if (fit.trustworthy()) continue;
    EXPECT_EQ(fit.model.fit.iterations, 1);
    EXPECT_THAT(fit.message(), testing::HasSubstr("1 iterations"));
  }
}

TEST(FitStatus, LinearProblemsAreSolvedAtOnceAndNoFitIsNotTrusted) {
  const DenseProblem problem = noisy_stage(HoldModel::none, 0.03);
  AdditiveModel start;
  start.submodels = {problem.model.submodels[0]};
  const FitResult fit = fit_additive_model(test::frf_of(problem), start, {});
  EXPECT_EQ(fit.status(), FitStatus::gradient_small);
  EXPECT_EQ(fit.model.fit.iterations, 0);
  EXPECT_FALSE(FitResult{}.trustworthy());
  EXPECT_TRUE(AdditiveModel{}.fit.trustworthy());  // the model of another program
}

TEST(FitStatus, TwoModesInOnePlaceAreNotReportedAsConverged) {
  const DenseProblem problem = noisy_stage(HoldModel::none, 0.03);
  AdditiveModel start = moved(problem.model, 1.0, 1.0);
  start.submodels[3].denominator = start.submodels[2].denominator;
  const FitResult fit = fit_additive_model(test::frf_of(problem), start, {});
  // Either the status reports it, or the fit has separated the modes and found the minimum.
  if (fit.trustworthy()) {
    const FitResult good =
        fit_additive_model(test::frf_of(problem), moved(problem.model, 1.0, 1.0));
    EXPECT_NEAR(fit.model.fit.cost, good.model.fit.cost, 1e-6 * good.model.fit.cost)
        << fit.message();
  } else {
    EXPECT_THAT(fit.message(),
                testing::AnyOf(testing::HasSubstr("coincide"), testing::HasSubstr("iterations"),
                               testing::HasSubstr("no step")));
  }
  for (const Submodel& s : fit.model.submodels) EXPECT_TRUE(s.numerator[0].allFinite());
}

TEST(FitThreads, DoNotChangeABit) {
  test::RandomStageSpec spec;
  spec.outputs = 3;
  spec.inputs = 5;
  spec.line_spacing_hz = 2.0;
  const test::RandomStage stage = test::draw_random_stage(17, spec);
  for (const DelayModel delay : {DelayModel::estimate, DelayModel::per_channel}) {
    FitOptions options =
        test::fit_options(Weighting::noise_variance, HoldModel::exact, delay, 1e-4);
    options.max_iterations = 6;
    options.threads = 1;
    const FitResult one = fit_additive_model(stage.frf, moved(stage.truth, 1.0004, 1.2), options);
    for (const int threads : {2, 3, 0}) {
      options.threads = threads;
      test::expect_same(one,
                        fit_additive_model(stage.frf, moved(stage.truth, 1.0004, 1.2), options));
    }
  }
}

}  // namespace stageid::test_fit_convergence
