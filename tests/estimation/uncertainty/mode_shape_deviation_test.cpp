// Standard deviations of mode shapes and masses, covariance of all parameters and circles around P, against
// differences, dense matrices and what happens when the measurement is repeated.

#include "estimation/uncertainty/mode_shape_deviation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "estimation/modal/mode_shapes.hpp"
#include "estimation/uncertainty/dense_covariance.hpp"
#include "tests/estimation/correlated_stage.hpp"
#include "tests/estimation/covariance_stage.hpp"
#include "tests/estimation/repeated_fits.hpp"

namespace stageid::test_mode_shape_deviation {

using test::covariance_stage;
using test::DenseProblem;

/// Shapes (real parts, imaginary parts) and mass of a mode, one under the other.
Eigen::VectorXd modal_quantities(const Submodel& s) {
  const ModeShape mode = mode_shape(s, 0);
  Eigen::VectorXd out(2 * (mode.output_shape.size() + mode.input_shape.size()) + 1);
  out << mode.output_shape.real(), mode.output_shape.imag(), mode.input_shape.real(),
      mode.input_shape.imag(), mode.modal_mass;
  return out;
}

Eigen::VectorXd reported(const Submodel& s) {
  const ModeShapeDeviation& d = s.shape_std.value();
  Eigen::VectorXd out(2 * (d.output_shape.size() + d.input_shape.size()) + 1);
  out << d.output_shape.real(), d.output_shape.imag(), d.input_shape.real(), d.input_shape.imag(),
      d.modal_mass;
  return out;
}

void expect_slopes(const Submodel& mode) {
  const ModeShapeSlopes slopes = mode_shape_slopes(mode);
  Eigen::MatrixXd J(modal_quantities(mode).size(), slopes.modal_mass.size());
  J << slopes.output_shape.real(), slopes.output_shape.imag(), slopes.input_shape.real(),
      slopes.input_shape.imag(), slopes.modal_mass;
  for (Eigen::Index p = 0; p < J.cols(); ++p) {
    const auto moved = [&](double by) {
      Submodel s = mode;
      const Eigen::Index n = s.numerator[0].size();
      double& value =
          p < 2 ? s.denominator[p + 1] : s.numerator[(p - 2) / n].reshaped()[(p - 2) % n];
      const double scale = p < 2 ? value : s.numerator[(p - 2) / n].norm();
      value += by * scale;
      return std::pair(modal_quantities(s), by * scale);
    };
    const double h = 1e-5;
    const auto [up, step] = moved(h);
    const auto [down, back] = moved(-h);
    // By as much as the parameter is large: of the second differences, h^2, and rounding, 1e-16 / h.
    const Eigen::VectorXd difference = (up - down) / (2.0 * h);
    const Eigen::VectorXd slope = J.col(p) * ((step - back) / (2.0 * h));
    EXPECT_LT((slope - difference).norm(), 1e-8 * (1.0 + difference.norm())) << "parameter " << p;
  }
}

TEST(ModeShapeSlopes, AreThoseOfDifferences) {
  Submodel mode = covariance_stage().model.submodels[1];
  expect_slopes(mode);  // a residue of full rank
  const Eigen::VectorXd phi{{0.6, -1.0}};
  const Eigen::VectorXd psi{{1.0, 0.3, -0.7}};
  mode.numerator[0] = phi * psi.transpose();
  expect_slopes(mode);  // of rank one, the leading component negative before it is turned
}

TEST(ModeShapeSlopes, OfGeneralDampingTurnWithTheLeadingComponent) {
  Submodel mode = covariance_stage().model.submodels[1];
  const double period_s = 1.0 / (2.0 * std::numbers::pi * mode.natural_frequency_hz());
  Eigen::MatrixXd velocity(2, 3);
  velocity << 0.4, -0.2, 0.7, 0.9, 0.1, -0.5;
  mode.numerator.emplace_back(period_s * mode.numerator[0].norm() * velocity);
  expect_slopes(mode);
}

TEST(ErrorQuantile, IsThatOfACircleAndOfALine) {
  EXPECT_NEAR(error_quantile_95(0.0), std::sqrt(-std::log(0.05)), 1e-7);
  EXPECT_NEAR(error_quantile_95(1.0), 1.959963985, 2e-4);  // the integrand has an essential zero
}

constexpr int kRuns = 200;

/// Expects the scatter of every quantity that is not held by its gauge, and the share of P that is inside its circle.
void expect_honest(const test::DenseProblem& problem, FitOptions options,
                   const std::function<FrfEstimate(std::uint64_t)>& measured) {
  options.threads = 1;
  double covered = 0.0;
  const test::RepeatedFits fits = test::repeat_fits(
      problem, options, measured,
      [&](const FrfEstimate& frf, FitResult& fit) -> test::Observed {
        fill_shape_deviations(frf, options, fit);
        fill_covariance(frf, options, fit);
        const Eigen::MatrixXcd P =
            test::reference_response(fit.model, problem.frequency_hz, problem.hold);
        covered += ((P - problem.G).cwiseAbs().array() < fit.covariance.response_radius.array())
                       .cast<double>()
                       .mean() /
                   kRuns;
        std::vector<double> value;
        std::vector<double> deviation;
        for (const Submodel& s : fit.model.submodels) {
          if (!s.is_mode()) continue;
          const Eigen::VectorXd quantities = modal_quantities(s);
          const Eigen::VectorXd deviations = reported(s);
          value.insert(value.end(), quantities.begin(), quantities.end());
          deviation.insert(deviation.end(), deviations.begin(), deviations.end());
        }
        const auto count = std::ssize(value);
        return {Eigen::Map<const Eigen::VectorXd>(value.data(), count),
                Eigen::Map<const Eigen::VectorXd>(deviation.data(), count)};
      },
      kRuns);
  std::vector<Eigen::Index> free;
  for (Eigen::Index q = 0; q < fits.reported.size(); ++q)
    if (fits.reported[q] > 1e-24) free.push_back(q);
  const Eigen::ArrayXd ratio = fits.scatter(free) / fits.reported(free);
  // chi^2 of 199 degrees of freedom over its mean: 99.99 % in 0.66 to 1.43.
  EXPECT_GT(ratio.minCoeff(), 0.66);
  EXPECT_LT(ratio.maxCoeff(), 1.43);
  EXPECT_NEAR(std::sqrt(ratio.mean()), 1.0, 0.1);
  // A fit has about 30 directions: 200 runs are some thousand independent trials.
  EXPECT_NEAR(covered, 0.95, 0.012);
}

TEST(ShapeDeviationMonteCarlo, FreeResidues) {
  const DenseProblem problem = covariance_stage();
  const Eigen::MatrixXd variance = problem.W.cwiseInverse();
  expect_honest(problem, test::options_with(Weighting::noise_variance), [&](std::uint64_t run) {
    test::RandomNumbers random(500 + run);
    return test::noisy_frf(random, problem, variance);
  });
}

class CorrelatedShapes : public testing::TestWithParam<std::pair<Weighting, int>> {};

TEST_P(CorrelatedShapes, AreAsSureAsReported) {
  const test::RankOneStage stage;
  FitOptions options = test::options_with(GetParam().first);
  options.residue_rank = GetParam().second;
  expect_honest(stage.problem, options,
                [&](std::uint64_t run) { return stage.measured_with(7000 + run); });
}

INSTANTIATE_TEST_SUITE_P(ShapeDeviationMonteCarlo, CorrelatedShapes,
                         testing::Values(std::pair(Weighting::noise_variance, 0),
                                         std::pair(Weighting::noise_variance, 1),
                                         std::pair(Weighting::likelihood, 0)));

TEST(DenseCovariance, HasTheDeviationsOfTheModelOnItsDiagonal) {
  const test::RankOneStage stage;
  const FrfEstimate frf = stage.measured_with(7000);
  for (const int rank : {0, 1}) {
    FitOptions options = test::options_with(Weighting::noise_variance);
    options.residue_rank = rank;
    FitResult fit = fit_additive_model(frf, stage.problem.model, options);
    fill_covariance(frf, options, fit);
    const Eigen::MatrixXd& C = fit.covariance.sandwich;
    ASSERT_GT(C.rows(), 0);
    Eigen::Index at = C.rows();
    for (const Submodel& s : fit.model.submodels) at -= s.numerator[0].size();
    for (const Submodel& s : fit.model.submodels)
      for (const double deviation : s.numerator_std[0].reshaped()) {
        EXPECT_NEAR(std::sqrt(C(at, at)), deviation, 1e-9 * deviation) << "rank " << rank;
        ++at;
      }
    EXPECT_LT((fit.response_variance.array() / fit.covariance.response_variance.array() - 1.0)
                  .abs()
                  .maxCoeff(),
              1e-6);
    EXPECT_EQ(C, C.transpose());
  }
}

TEST(DenseCovariance, WithoutCorrelationAndWithTheRightWeightsIsTheInverseFisherMatrix) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(3);
  const FrfEstimate frf = test::noisy_frf(random, problem, problem.W.cwiseInverse());
  const FitOptions options = test::options_with(Weighting::noise_variance);
  FitResult fit = fit_additive_model(frf, problem.model, options);
  fill_covariance(frf, options, fit);
  const FitCovariance& C = fit.covariance;
  const Eigen::VectorXd scale = C.sandwich.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (C.sandwich - C.likelihood) * scale.asDiagonal()).norm(), 1e-6);
}

TEST(DenseCovariance, FollowsTheOrderOfTheSubmodels) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(5);
  const FrfEstimate frf = test::noisy_frf(random, problem, problem.W.cwiseInverse());
  const FitOptions options = test::options_with(Weighting::noise_variance);
  FitResult fit = fit_additive_model(frf, problem.model, options);
  AdditiveModel reversed = problem.model;
  std::ranges::reverse(reversed.submodels);
  FitResult other = fit_additive_model(frf, reversed, options);
  std::vector<std::size_t> back(reversed.submodels.size());
  for (std::size_t i = 0; i < back.size(); ++i) back[i] = back.size() - 1 - i;
  rearrange(back, other);

  fill_covariance(frf, options, fit);
  fill_covariance(frf, options, other);
  const Eigen::MatrixXd& C = fit.covariance.sandwich;
  ASSERT_EQ(C.rows(), other.covariance.sandwich.rows());
  ASSERT_GT(C.rows(), 0);
  const Eigen::VectorXd scale = C.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (C - other.covariance.sandwich) * scale.asDiagonal())
                .cwiseAbs()
                .maxCoeff(),
            1e-3);  // both fits end within 1e-4 standard deviations
}

TEST(DenseCovariance, SaysWhyThereIsNone) {
  const DenseProblem problem = covariance_stage();
  FitOptions options = test::options_with(Weighting::relative);
  options.uncertainty = false;
  FitResult fit = fit_additive_model(test::frf_of(problem), problem.model, options);
  fill_covariance(test::frf_of(problem), options, fit);
  EXPECT_EQ(fit.covariance.sandwich.size(), 0);
  ASSERT_FALSE(fit.decisions.empty());
  EXPECT_NE(fit.decisions.back().find("no standard deviations"), std::string::npos);
}

}  // namespace stageid::test_mode_shape_deviation
