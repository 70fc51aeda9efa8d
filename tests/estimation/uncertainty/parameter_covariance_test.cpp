// The uncertainty reported by a fit, compared with the dense Fisher and sandwich matrices.

#include "estimation/uncertainty/parameter_covariance.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "estimation/search/fit_additive_model.hpp"
#include "tests/estimation/covariance_stage.hpp"
#include "tests/estimation/delayed_fit_options.hpp"

namespace stageid {
namespace test_parameter_covariance {

using test::covariance_stage;
using test::DenseProblem;
using test::noisy;
using test::options_with;

// Dense ----------------------------------------------------------------------------------------------

/// J of all parameters on all lines, the common delay's column last, (n_c N) x (n_theta + 1).
Eigen::MatrixXcd dense_jacobian(const DenseProblem& problem) {
  const Eigen::Index n = test::first_of_theta(problem.model).back();
  const Eigen::Index n_c = problem.channels();
  Eigen::MatrixXcd J(n_c * problem.G.cols(), n + 1);
  for (Eigen::Index k = 0; k < problem.G.cols(); ++k)
    J.block(k * n_c, 0, n_c, n) = test::instrument_rows(problem, k);
  const double h = 1e-7;
  const auto shifted = [&](double by) {
    AdditiveModel model = problem.model;
    model.input_delay_s.array() += by;
    return test::reference_response(model, problem.frequency_hz, problem.hold);
  };
  const Eigen::MatrixXcd slope =
      (8.0 * (shifted(h) - shifted(-h)) - (shifted(2.0 * h) - shifted(-2.0 * h))) / (12.0 * h);
  J.col(n) = slope.reshaped();
  return J;
}

/// 1/2 M^-1 K M^-1, M = Re{J^H W J}, K = Re{J^H W C W J}.
Eigen::MatrixXd dense_covariance(const Eigen::MatrixXcd& J, const Eigen::VectorXd& W,
                                 const Eigen::VectorXd& variance) {
  const auto gram = [&](const Eigen::VectorXd& weights) {
    return Eigen::MatrixXd(
        (J.adjoint() * weights.cast<std::complex<double>>().asDiagonal() * J).real());
  };
  const Eigen::MatrixXd M = gram(W);
  const Eigen::VectorXd scale = M.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd inverse =
      scale.asDiagonal() * (scale.asDiagonal() * M * scale.asDiagonal()).fullPivLu().inverse() *
      scale.asDiagonal();
  return 0.5 * inverse * gram(W.cwiseProduct(W).cwiseProduct(variance)) * inverse;
}

void expect_numerator_deviations(const AdditiveModel& model, const Eigen::MatrixXd& C) {
  const std::vector<Eigen::Index> first = test::first_of_theta(model);
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Submodel& s = model.submodels[i];
    ASSERT_EQ(s.numerator_std.size(), s.numerator.size());
    Eigen::Index at = first[i] + static_cast<Eigen::Index>(s.denominator.size()) - 1;
    for (const Eigen::MatrixXd& deviations : s.numerator_std) {
      ASSERT_EQ(deviations.rows(), model.n_outputs());
      for (const double deviation : deviations.reshaped()) {
        EXPECT_NEAR(deviation, std::sqrt(C(at, at)), 1e-6 * std::sqrt(C(at, at)))
            << "submodel " << i;
        ++at;
      }
    }
  }
}

void expect_dense_uncertainty(const DenseProblem& problem, const FitResult& fit,
                              const Eigen::MatrixXd& W, const Eigen::MatrixXd& variance) {
  DenseProblem at_estimate = problem;
  at_estimate.model = fit.model;
  const Eigen::MatrixXcd J = dense_jacobian(at_estimate);
  const Eigen::MatrixXd C = dense_covariance(J, W.reshaped(), variance.reshaped());
  const std::vector<Eigen::Index> first = test::first_of_theta(fit.model);
  for (std::size_t i = 1; i < fit.model.submodels.size(); ++i) {
    const Submodel& s = fit.model.submodels[i];
    const Eigen::Index a = first[i];
    const double f = s.natural_frequency_hz();
    // f = 1 / (2 pi sqrt a_2), zeta = a_1 / (2 sqrt a_2)
    const double a1 = s.denominator[1];
    const double a2 = s.denominator[2];
    const double f_std = 0.5 * f / a2 * std::sqrt(C(a + 1, a + 1));
    const double zeta_variance =
        std::pow(s.damping_ratio(), 2) *
        (C(a, a) / (a1 * a1) - C(a, a + 1) / (a1 * a2) + C(a + 1, a + 1) / (4.0 * a2 * a2));
    ASSERT_TRUE(s.natural_frequency_std_hz && s.damping_ratio_std);
    // The inverse of a matrix of condition 1e5 after scaling, and 1e-9 of the differences.
    EXPECT_NEAR(*s.natural_frequency_std_hz, f_std, 1e-6 * f_std);
    EXPECT_NEAR(*s.damping_ratio_std, std::sqrt(zeta_variance), 1e-6 * std::sqrt(zeta_variance));
  }
  expect_numerator_deviations(fit.model, C);
  ASSERT_EQ(fit.response_variance.rows(), problem.channels());
  ASSERT_EQ(fit.response_variance.cols(), problem.G.cols());
  const Eigen::VectorXd expected =
      (J * C.cast<std::complex<double>>()).cwiseProduct(J.conjugate()).rowwise().sum().real();
  for (Eigen::Index r = 0; r < expected.size(); ++r)
    EXPECT_NEAR(fit.response_variance.reshaped()[r], expected[r], 1e-5 * expected[r]);
}

TEST(Covariance, OfMaximumLikelihoodIsTheInverseFisherMatrix) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(31);
  const Eigen::MatrixXd variance = problem.W.cwiseInverse();
  FrfEstimate frf = test::frf_of(problem);
  frf.response = noisy(random, problem, variance);
  frf.noise_variance = variance;
  const FitResult fit =
      fit_additive_model(frf, problem.model, options_with(Weighting::noise_variance));
  ASSERT_TRUE(fit.trustworthy()) << fit.message;
  expect_dense_uncertainty(problem, fit, problem.W, variance);
  frf.total_variance = variance;
  frf.noise_variance.resize(0, 0);
  const FitResult total =
      fit_additive_model(frf, problem.model, options_with(Weighting::total_variance));
  expect_dense_uncertainty(problem, total, problem.W, variance);
}

TEST(Covariance, OfOtherWeightsIsTheSandwich) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(32);
  const Eigen::MatrixXd variance = problem.W.cwiseInverse();
  FrfEstimate frf = test::frf_of(problem);
  frf.response = noisy(random, problem, variance);
  frf.noise_variance = variance;
  for (const Weighting weighting :
       {Weighting::relative, Weighting::inverse_magnitude, Weighting::unit}) {
    const FitOptions options = options_with(weighting);
    const FitResult fit = fit_additive_model(frf, problem.model, options);
    ASSERT_TRUE(fit.trustworthy()) << fit.message;
    expect_dense_uncertainty(problem, fit, make_weights(frf, options), variance);
  }
}

// Nonlinear distortion scatters from realization to realization, and only the total variance has it.
TEST(Covariance, OfOtherWeightsTakesTheTotalVarianceWhereThereIsOne) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(36);
  const Eigen::MatrixXd variance = problem.W.cwiseInverse();
  FrfEstimate frf = test::frf_of(problem);
  frf.response = noisy(random, problem, variance);
  frf.noise_variance = 0.1 * variance;
  frf.total_variance = variance;
  const FitOptions options = options_with(Weighting::relative);
  const FitResult fit = fit_additive_model(frf, problem.model, options);
  ASSERT_TRUE(fit.trustworthy()) << fit.message;
  expect_dense_uncertainty(problem, fit, make_weights(frf, options), variance);
}

// The scatter of weights from variances with few degrees of freedom raises the covariance.
TEST(Covariance, OfEstimatedVariancesCountsTheScatterOfTheWeights) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(37);
  const Eigen::MatrixXd variance = problem.W.cwiseInverse();
  FrfEstimate frf = test::frf_of(problem);
  frf.response = noisy(random, problem, variance);
  frf.noise_dof = 9.0;
  frf.noise_variance = variance;
  for (double& value : frf.noise_variance.reshaped()) value *= random.chi_square_mean(9.0);
  const FitOptions options = options_with(Weighting::noise_variance);
  const FitResult fit = fit_additive_model(frf, problem.model, options);
  ASSERT_TRUE(fit.trustworthy()) << fit.message;
  expect_dense_uncertainty(problem, fit, make_weights(frf, options),
                           test::values(weighed_variance(frf, Weighting::noise_variance)));
}

TEST(Covariance, WithoutVariancesIsScaledByTheResidual) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(33);
  FrfEstimate frf = test::frf_of(problem);
  frf.response = noisy(random, problem, 1e-4 * problem.G.cwiseAbs2());
  const FitResult fit = fit_additive_model(frf, problem.model, options_with(Weighting::relative));
  ASSERT_TRUE(fit.trustworthy()) << fit.message;
  const auto N = static_cast<double>(problem.G.cols());
  const double parameters = 4.0 * 6.0 + 6.0 + 1.0;
  const double scale = 2.0 * N * fit.model.fit.cost / (6.0 * N - 0.5 * parameters);
  const Eigen::MatrixXd W = frf.response.cwiseAbs2().cwiseInverse();
  expect_dense_uncertainty(problem, fit, W, scale * W.cwiseInverse());
}

TEST(Covariance, IsRaisedAndSaidSoWhereTheModelDoesNotExplainTheData) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(34);
  const Eigen::MatrixXd variance = problem.W.cwiseInverse();
  FrfEstimate frf = test::frf_of(problem);
  frf.response = noisy(random, problem, 4.0 * variance);
  frf.noise_variance = variance;  // a quarter of the true one
  const FitResult fit =
      fit_additive_model(frf, problem.model, options_with(Weighting::noise_variance));
  ASSERT_FALSE(fit.decisions.empty());
  EXPECT_THAT(fit.decisions.back(), testing::HasSubstr("does not explain the data"));
  const auto N = static_cast<double>(problem.G.cols());
  const double scale = 2.0 * N * fit.model.fit.cost / (6.0 * N - 0.5 * 31.0);
  EXPECT_NEAR(scale, 4.0, 4.0 * 4.0 / std::sqrt(6.0 * N));  // four standard deviations
  expect_dense_uncertainty(problem, fit, problem.W, scale * variance);
}

// Outputs that a disturbance moves together, Cov(vec G) = (input part) kron C_E: the covariance includes this
// correlation, diagonal weights do not.
TEST(Covariance, CountsTheCorrelationOfTheOutputs) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(35);
  const Eigen::MatrixXd variance = problem.W.cwiseInverse();
  const std::complex<double> rho(0.6, 0.55);  // E e_1 conj(e_2) over the deviations
  FrfEstimate frf = test::frf_of(problem);
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    for (Eigen::Index u = 0; u < 3; ++u) {
      const std::complex<double> first = random.circular();
      const std::complex<double> second =
          std::conj(rho) * first + std::sqrt(1.0 - std::norm(rho)) * random.circular();
      frf.response(2 * u, k) += std::sqrt(variance(2 * u, k)) * first;
      frf.response(2 * u + 1, k) += std::sqrt(variance(2 * u + 1, k)) * second;
    }
  frf.noise_variance = variance;
  // Any scale, because only the correlation is used.
  frf.residual_covariance_re.resize(4, frf.lines());
  frf.residual_covariance_im.resize(4, frf.lines());
  const double a = 3.0;
  const double b = 0.2;
  frf.residual_covariance_re.colwise() =
      Eigen::Vector4d(a * a, a * b * rho.real(), a * b * rho.real(), b * b);
  frf.residual_covariance_im.colwise() =  // (2,1) before (1,2): columns are stacked
      Eigen::Vector4d(0.0, -a * b * rho.imag(), a * b * rho.imag(), 0.0);
  const FitResult fit =
      fit_additive_model(frf, problem.model, options_with(Weighting::noise_variance));
  ASSERT_TRUE(fit.trustworthy()) << fit.message;

  DenseProblem at_estimate = problem;
  at_estimate.model = fit.model;
  const Eigen::MatrixXcd J = dense_jacobian(at_estimate);
  const Eigen::VectorXd W = problem.W.reshaped();
  const Eigen::VectorXd deviation = variance.reshaped().cwiseSqrt();
  // C W J for the C of every line and input: pairs of rows.
  Eigen::MatrixXcd CWJ(J.rows(), J.cols());
  for (Eigen::Index row = 0; row < J.rows(); row += 2) {
    const Eigen::RowVectorXcd one = deviation[row] * W[row] * J.row(row);
    const Eigen::RowVectorXcd two = deviation[row + 1] * W[row + 1] * J.row(row + 1);
    CWJ.row(row) = deviation[row] * (one + rho * two);
    CWJ.row(row + 1) = deviation[row + 1] * (std::conj(rho) * one + two);
  }
  const Eigen::MatrixXd M = (J.adjoint() * W.cast<std::complex<double>>().asDiagonal() * J).real();
  const Eigen::MatrixXd K =
      (J.adjoint() * W.cast<std::complex<double>>().asDiagonal() * CWJ).real();
  const Eigen::VectorXd scale = M.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd inverse =
      scale.asDiagonal() * (scale.asDiagonal() * M * scale.asDiagonal()).fullPivLu().inverse() *
      scale.asDiagonal();
  const Eigen::MatrixXd C = 0.5 * inverse * K * inverse;
  const Eigen::MatrixXd without = dense_covariance(J, W, variance.reshaped());
  const std::vector<Eigen::Index> first = test::first_of_theta(fit.model);
  double largest_change = 0.0;
  for (std::size_t i = 1; i < fit.model.submodels.size(); ++i) {
    const Submodel& s = fit.model.submodels[i];
    const Eigen::Index at = first[i] + 1;
    const double expected =
        0.5 * s.natural_frequency_hz() / s.denominator[2] * std::sqrt(C(at, at));
    EXPECT_NEAR(*s.natural_frequency_std_hz, expected, 1e-6 * expected);
    largest_change =
        std::max(largest_change, std::abs(std::sqrt(C(at, at) / without(at, at)) - 1.0));
  }
  EXPECT_GT(largest_change, 0.05) << "a correlation that changes nothing tests nothing";
  // The response's variance is that of J C J^H with the same C.
  const Eigen::VectorXd expected =
      (J * C.cast<std::complex<double>>()).cwiseProduct(J.conjugate()).rowwise().sum().real();
  for (Eigen::Index r = 0; r < expected.size(); ++r)
    EXPECT_NEAR(fit.response_variance.reshaped()[r], expected[r], 1e-5 * expected[r]);
  expect_numerator_deviations(fit.model, C);
}

TEST(Covariance, IsNotComputedUnlessAsked) {
  const DenseProblem problem = covariance_stage();
  FitOptions options = options_with(Weighting::relative);
  options.uncertainty = false;
  const FitResult fit = fit_additive_model(test::frf_of(problem), problem.model, options);
  EXPECT_EQ(fit.response_variance.size(), 0);
  EXPECT_TRUE(fit.model.submodels[1].numerator_std.empty());
  EXPECT_FALSE(fit.model.submodels[1].natural_frequency_std_hz.has_value());
}

}  // namespace test_parameter_covariance
}  // namespace stageid
