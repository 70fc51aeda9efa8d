// Fits with weight matrices, against the same cost written out densely.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "estimation/equations/joint_equations.hpp"
#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/search/automatic_fit.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "tests/estimation/correlated_stage.hpp"
#include "tests/support/models/expect_same_fit.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_likelihood_fit {

using test::correlated_noise;
using test::CorrelatedNoise;
using test::DenseEquations;
using test::DenseProblem;
using test::Measurement;
using test::options_with;
using test::RandomNumbers;

double dense_cost(const AdditiveModel& model, const FrfEstimate& frf,
                  const CorrelatedNoise& noise) {
  const Eigen::MatrixXcd E =
      frf.response - test::reference_response(model, frf.frequency_hz, model.hold);
  double sum = 0.0;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd W = inverse(noise.covariance(static_cast<std::size_t>(k)));
    sum += (E.col(k).adjoint() * W * E.col(k))(0, 0).real();
  }
  return sum / (2.0 * static_cast<double>(frf.lines()));
}

DenseEquations dense_equations(const DenseProblem& at, const FrfEstimate& frf,
                               const CorrelatedNoise& noise, DelayModel delay) {
  return test::dense_equations(at, frf.response, delay, [&](std::size_t k) -> Eigen::MatrixXcd {
    return inverse(noise.covariance(k));
  });
}

/// max_i |e_i| / sqrt(M_ii sum E^H W E).
double first_order_condition(const DenseEquations& dense, double cost, Eigen::Index lines) {
  const double squares = 2.0 * static_cast<double>(lines) * cost;
  return (dense.e.array().abs() / (dense.M.diagonal().array() * squares).sqrt()).maxCoeff();
}

TEST(LikelihoodFit, CostIsThatOfTheKroneckerProductWrittenOut) {
  const Measurement m;
  FitOptions options = options_with(Weighting::likelihood);
  for (const int iterations : {0, 1, 100}) {
    options.max_iterations = iterations;
    const FitResult fit = fit_additive_model(m.frf, m.start(), options);
    const double expected = dense_cost(fit.model, m.frf, m.noise);
    EXPECT_NEAR(fit.model.fit.cost, expected, 1e-9 * expected) << iterations;
  }
}

TEST(LikelihoodFit, EndsWhereTheDenseFirstOrderConditionHolds) {
  const Measurement m;
  FitOptions options = options_with(Weighting::likelihood);
  options.deviation_tolerance = 1e-7;
  const FitResult fit = fit_additive_model(m.frf, m.start(), options);
  ASSERT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_LT(fit.deviations, 1e-3);  // before the last step
  for (std::size_t i = 1; i < fit.cost.size(); ++i) EXPECT_LT(fit.cost[i], fit.cost[i - 1]);
  DenseProblem at = m.problem;
  at.model = fit.model;
  const DenseEquations dense = dense_equations(at, m.frf, m.noise, DelayModel::estimate);
  // 1e-7 deviations are 1e-7 / sqrt(2400) of the residual; the delay's column is good to 1e-9.
  EXPECT_LT(first_order_condition(dense, fit.model.fit.cost, m.frf.lines()), 1e-8);

  // The diagonal fit does not satisfy it, so the test is sensitive to the difference.
  at.model = fit_additive_model(m.frf, m.start(), options_with(Weighting::noise_variance)).model;
  const DenseEquations diagonal = dense_equations(at, m.frf, m.noise, DelayModel::estimate);
  EXPECT_GT(first_order_condition(diagonal, dense_cost(at.model, m.frf, m.noise), m.frf.lines()),
            1e-3);
}

TEST(LikelihoodFit, OperatorIsTheDenseMatrixWithEveryKindOfDelay) {
  for (const DelayModel delay :
       {DelayModel::fixed, DelayModel::estimate, DelayModel::per_channel}) {
    Measurement m;
    m.problem.model.output_delay_s = Eigen::VectorXd{{0.3e-4, 0.0}};
    m.problem.model.submodels[2].numerator.push_back(1e-3 *
                                                     m.problem.model.submodels[2].numerator[0]);
    m.problem.G = m.frf.response;
    const WeightMatrices weights = WeightMatrices::likelihood(m.frf);
    m.problem.W = weights.marginal();
    const FitProblem problem = test::fit_problem(m.problem, delay);
    const FitParameters beta = test::fit_parameters(m.problem);
    const std::vector<BasisGroup> groups = evaluate_groups(problem, beta, true);
    const SplitMatrix E = residual(problem, groups, beta.B);
    const JointEquations equations(problem, weights, beta, groups, E);
    const DenseEquations dense = dense_equations(m.problem, m.frf, m.noise, delay);
    ASSERT_EQ(equations.size(), dense.e.size());
    const Eigen::VectorXd scale = dense.M.diagonal().cwiseSqrt();
    const double size = dense.e.cwiseQuotient(scale).norm();
    EXPECT_LT((equations.gradient() - dense.e).cwiseQuotient(scale).norm(), 1e-8 * size);
    RandomNumbers random(17);
    const Eigen::VectorXd v = test::random_vector(random, dense.e.size()).cwiseQuotient(scale);
    const Eigen::VectorXd expected = dense.M * v;
    EXPECT_LT((equations.product(v) - expected).cwiseQuotient(scale).norm(),
              1e-8 * expected.cwiseQuotient(scale).norm());
    // And the conjugate gradients undo it.
    const JointEquations::Solution solution = equations.solve(expected, {}, 1e-9);
    EXPECT_TRUE(solution.converged);
    EXPECT_LT((solution.x - v).cwiseProduct(scale).norm(), 1e-5 * v.cwiseProduct(scale).norm());
    // A frozen global stays where it is.
    EXPECT_EQ(equations.solve(expected, {1}, 1e-3).x[1], 0.0);
  }
}

TEST(LikelihoodFit, IsTheDiagonalFitWhereNothingIsCorrelated) {
  Measurement m;
  for (std::size_t k = 0; k < m.noise.C.size(); ++k) {
    m.noise.C[k] = Eigen::MatrixXcd(m.noise.C[k].diagonal().asDiagonal());
    m.noise.S[k] = Eigen::MatrixXcd(m.noise.S[k].diagonal().asDiagonal());
  }
  RandomNumbers random(6);
  m.frf = test::measured(m.problem, m.noise, random);
  const FitResult joint = fit_additive_model(m.frf, m.start(), options_with(Weighting::likelihood));
  const FitResult diagonal =
      fit_additive_model(m.frf, m.start(), options_with(Weighting::noise_variance));
  ASSERT_TRUE(joint.trustworthy());
  EXPECT_NEAR(joint.model.fit.cost, diagonal.model.fit.cost, 1e-10 * diagonal.model.fit.cost);
  for (std::size_t i = 1; i < 4; ++i) {
    const Submodel& a = joint.model.submodels[i];
    const Submodel& b = diagonal.model.submodels[i];
    // Both stop within 1e-4 standard deviations.
    EXPECT_NEAR(a.natural_frequency_hz(), b.natural_frequency_hz(),
                2e-4 * *b.natural_frequency_std_hz);
    EXPECT_NEAR(*a.natural_frequency_std_hz, *b.natural_frequency_std_hz,
                1e-4 * *b.natural_frequency_std_hz);
    EXPECT_NEAR(*a.damping_ratio_std, *b.damping_ratio_std, 1e-4 * *b.damping_ratio_std);
  }
  EXPECT_LT((joint.response_variance - diagonal.response_variance)
                .cwiseQuotient(diagonal.response_variance)
                .cwiseAbs()
                .maxCoeff(),
            1e-3);
}

/// Checks the deviations of frequencies against 1/2 M^-1 and returns the response's reported variance
/// over J C J^H, n_c x N.
Eigen::MatrixXd expect_fisher_deviations(const Measurement& m) {
  const FitResult fit = fit_additive_model(m.frf, m.start(), options_with(Weighting::likelihood));
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  DenseProblem at = m.problem;
  at.model = fit.model;
  const Eigen::MatrixXd C =
      0.5 * test::scaled_inverse(dense_equations(at, m.frf, m.noise, DelayModel::estimate).M);
  // Conjugate gradients to 1e-2 in the norm of the arrow, variances to its square, and the true norm is larger by the
  // condition of the correlations, 1e3 here, at its worst.
  for (Eigen::Index i = 0; i < 3; ++i)
    test::expect_mode_deviations(fit.model.submodels[i + 1], C.block<2, 2>(2 * i, 2 * i), 5e-3);
  const std::vector<Eigen::MatrixXcd> J = test::joint_jacobian(at, DelayModel::estimate);
  Eigen::MatrixXd ratio = fit.response_variance;
  for (Eigen::Index k = 0; k < ratio.cols(); ++k) {
    const Eigen::MatrixXcd& J_k = J[k];
    for (Eigen::Index c = 0; c < ratio.rows(); ++c)
      ratio(c, k) /= (J_k.row(c) * C * J_k.row(c).adjoint())(0, 0).real();
  }
  return ratio;
}

TEST(LikelihoodFit, UncertaintyIsTheInverseFisherMatrix) {
  // Correlations that turn from line to line: the band is never too narrow.
  EXPECT_GT(expect_fisher_deviations(Measurement()).minCoeff(), 1.0 - 1e-2);
  // Real ones that stay, whatever the levels do: it is exact.
  Measurement m;
  for (std::size_t k = 0; k < m.noise.C.size(); ++k) {
    const double level = 1.0 + std::cos(0.05 * static_cast<double>(k)) / 1.1;
    m.noise.C[k] = level * m.noise.C[0].real().cast<std::complex<double>>();
    m.noise.S[k] = m.noise.S[0].real().cast<std::complex<double>>();
  }
  RandomNumbers random(9);
  m.frf = test::measured(m.problem, m.noise, random);
  const Eigen::MatrixXd ratio = expect_fisher_deviations(m);
  EXPECT_NEAR(ratio.minCoeff(), 1.0, 1e-2);
  EXPECT_NEAR(ratio.maxCoeff(), 1.0, 1e-2);
}

TEST(LikelihoodFit, WholeMatricesOfAUserGiveTheSameModel) {
  const Measurement m;
  FitOptions options = options_with(Weighting::user);
  options.user_weight_matrices.resize(36, m.frf.lines());
  for (Eigen::Index k = 0; k < m.frf.lines(); ++k)
    options.user_weight_matrices.col(k) =
        inverse(m.noise.covariance(static_cast<std::size_t>(k))).reshaped();
  const FitResult whole = fit_additive_model(m.frf, m.start(), options);
  const FitResult factors =
      fit_additive_model(m.frf, m.start(), options_with(Weighting::likelihood));
  ASSERT_TRUE(whole.trustworthy()) << whole.message();
  EXPECT_NEAR(whole.model.fit.cost, factors.model.fit.cost, 1e-9 * factors.model.fit.cost);
  const double parameters = 4.0 * 6.0 + 6.0 + 1.0;
  const auto N = static_cast<double>(m.frf.lines());
  const double scale = 2.0 * N * whole.model.fit.cost / (6.0 * N - 0.5 * parameters);
  for (std::size_t i = 1; i < 4; ++i) {
    const double deviation = *factors.model.submodels[i].natural_frequency_std_hz;
    EXPECT_NEAR(whole.model.submodels[i].natural_frequency_hz(),
                factors.model.submodels[i].natural_frequency_hz(), 1e-4 * deviation);
    // The scale of a user's weights is not trusted: it is estimated from the residual.
    EXPECT_NEAR(*whole.model.submodels[i].natural_frequency_std_hz, std::sqrt(scale) * deviation,
                5e-3 * deviation);
  }
}

TEST(LikelihoodFit, DoesNotDependOnTheNumberOfThreads) {
  Measurement m;
  m.problem.frequency_hz = Eigen::VectorXd::LinSpaced(700, 20.0, 1800.0);  // more than two tiles
  m.problem.G = test::reference_response(m.problem.model, m.problem.frequency_hz, m.problem.hold);
  RandomNumbers random(8);
  m.frf = test::measured(m.problem, correlated_noise(m.problem, 0.02, 0.95), random, 3);
  FitOptions options = options_with(Weighting::likelihood);
  options.threads = 1;
  const FitResult one = fit_additive_model(m.frf, m.start(), options);
  for (const int threads : {2, 5}) {
    options.threads = threads;
    test::expect_same(one, fit_additive_model(m.frf, m.start(), options));
  }
}

TEST(LikelihoodFit, AutomaticFitChoosesByTheDiagonalAndEndsWithTheLikelihood) {
  const Measurement m;
  const FitResult fit =
      automatic_fit(m.frf, {.rigid_body = true}, {}, options_with(Weighting::likelihood));
  ASSERT_TRUE(fit.trustworthy()) << fit.message();
  ASSERT_EQ(fit.model.submodels.size(), 4U);
  EXPECT_EQ(fit.model.fit.weighting, "likelihood");
  const double expected = dense_cost(fit.model, m.frf, m.noise);
  EXPECT_NEAR(fit.model.fit.cost, expected, 1e-9 * expected);
  for (std::size_t i = 1; i < 4; ++i)
    EXPECT_NEAR(fit.model.submodels[i].natural_frequency_hz(),
                m.problem.model.submodels[i].natural_frequency_hz(),
                4.0 * *fit.model.submodels[i].natural_frequency_std_hz);
}

TEST(LikelihoodFit, ModesAtABoundAreHeld) {
  const Measurement m;
  AdditiveModel start = m.start();
  // A mode far below the lines that the data do not require.
  start.submodels.push_back(test::empty_mode(m.problem.model, 4.0, 0.3));
  const FitResult fit = fit_additive_model(m.frf, start, options_with(Weighting::likelihood));
  EXPECT_TRUE(std::isfinite(fit.model.fit.cost)) << fit.message();
  for (std::size_t i = 1; i < fit.cost.size(); ++i) EXPECT_LT(fit.cost[i], fit.cost[i - 1]);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  const Submodel& held = fit.model.submodels.back();
  EXPECT_GE(held.natural_frequency_hz(), 4.0 * (1.0 - 1e-6));  // the start's own, below 20 Hz / 4
  EXPECT_LE(held.damping_ratio(), 0.9 * (1.0 + 1e-9));
}

TEST(LikelihoodFit, RefusesAMethodWithoutAMinimum) {
  const Measurement m;
  FitOptions options = options_with(Weighting::likelihood);
  options.method = FitMethod::sk;
  EXPECT_THAT(test::error_message<std::invalid_argument>(
                  [&] { fit_additive_model(m.frf, m.start(), options); }),
              testing::HasSubstr("riv or gn"));
}

}  // namespace stageid::test_likelihood_fit
