// The uncertainty reported by a fit, compared with the dense Fisher and sandwich matrices.

#include "estimation/uncertainty/parameter_covariance.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "estimation/fit/fit_additive_model.hpp"
#include "tests/estimation/correlated_stage.hpp"
#include "tests/estimation/covariance_stage.hpp"

namespace stageid::test_parameter_covariance {

using test::covariance_stage;
using test::DenseProblem;
using test::noisy_frf;
using test::options_with;

/// J of all parameters at the estimate on all lines, (n_c N) x n.
Eigen::MatrixXcd dense_jacobian(DenseProblem problem, const FitResult& fit) {
  problem.model = fit.model;
  const std::vector<Eigen::MatrixXcd> lines = test::joint_jacobian(problem, DelayModel::estimate);
  const Eigen::Index n_c = problem.channels();
  Eigen::MatrixXcd J(n_c * problem.G.cols(), lines[0].cols());
  for (std::size_t k = 0; k < lines.size(); ++k)
    J.middleRows(static_cast<Eigen::Index>(k) * n_c, n_c) = lines[k];
  return J;
}

/// 1/2 M^-1 K M^-1, M = Re{J^H W J}, K = Re{J^H W C W J}. @param CWJ C W J
Eigen::MatrixXd sandwich(const Eigen::MatrixXcd& J, const Eigen::VectorXd& W,
                         const Eigen::MatrixXcd& CWJ) {
  const Eigen::MatrixXcd WJ = W.cast<std::complex<double>>().asDiagonal() * J;
  const Eigen::MatrixXd inverse = test::scaled_inverse((WJ.adjoint() * J).real());
  return 0.5 * inverse * (WJ.adjoint() * CWJ).real() * inverse;
}

/// The same for uncorrelated noise.
Eigen::MatrixXd dense_covariance(const Eigen::MatrixXcd& J, const Eigen::MatrixXd& W,
                                 const Eigen::MatrixXd& variance) {
  const Eigen::VectorXcd scale = W.cwiseProduct(variance).reshaped().cast<std::complex<double>>();
  return sandwich(J, W.reshaped(), scale.asDiagonal() * J);
}

/// Expects the deviations of modes, numerators and response of the covariance C.
void expect_uncertainty(const FitResult& fit, const Eigen::MatrixXcd& J, const Eigen::MatrixXd& C) {
  Eigen::Index a = 0;
  Eigen::Index b = C.rows();
  for (const Submodel& s : fit.model.submodels)
    b -= std::ssize(s.numerator) * s.numerator[0].size();
  for (const Submodel& s : fit.model.submodels) {
    // The inverse of a matrix of condition 1e5 after scaling, and 1e-9 of the differences.
    if (s.is_mode()) test::expect_mode_deviations(s, C.block<2, 2>(a, a), 1e-6);
    a += s.order();
    ASSERT_EQ(s.numerator_std.size(), s.numerator.size());
    for (const Eigen::MatrixXd& deviations : s.numerator_std) {
      ASSERT_EQ(deviations.rows(), fit.model.n_outputs());
      for (const double deviation : deviations.reshaped()) {
        EXPECT_NEAR(deviation, std::sqrt(C(b, b)), 1e-6 * std::sqrt(C(b, b))) << "parameter " << b;
        ++b;
      }
    }
  }
  ASSERT_EQ(fit.response_variance.rows(), 6);
  const Eigen::VectorXd expected =
      (J * C.cast<std::complex<double>>()).cwiseProduct(J.conjugate()).rowwise().sum().real();
  ASSERT_EQ(fit.response_variance.size(), expected.size());
  for (Eigen::Index r = 0; r < expected.size(); ++r)
    EXPECT_NEAR(fit.response_variance.reshaped()[r], expected[r], 1e-5 * expected[r]);
}

struct Covariance : testing::Test {
  FitResult fit(Weighting weighting) const {
    return fit_additive_model(frf_, problem_.model, options_with(weighting));
  }
  void expect_dense(const FitResult& fit, const Eigen::MatrixXd& W,
                    const Eigen::MatrixXd& variance) const {
    const Eigen::MatrixXcd J = dense_jacobian(problem_, fit);
    expect_uncertainty(fit, J, dense_covariance(J, W, variance));
  }
  /// Fits, with the weights of the library and data of this variance.
  void expect_dense(Weighting weighting, const Eigen::MatrixXd& variance) const {
    const FitResult found = fit(weighting);
    ASSERT_TRUE(found.trustworthy()) << found.message();
    expect_dense(found, make_weights(frf_, options_with(weighting)), variance);
  }
  /// sum W |E|^2 over its degrees of freedom.
  double residual_over_degrees(const FitResult& fit) const {
    const double parameters = 4.0 * 6.0 + 6.0 + 1.0;
    return 2.0 * N_ * fit.model.fit.cost / (6.0 * N_ - 0.5 * parameters);
  }
  void measure(std::uint64_t seed, double factor = 1.0) {
    test::RandomNumbers random(seed);
    frf_ = noisy_frf(random, problem_, factor * variance_);
    frf_.noise_variance = variance_;
  }

  DenseProblem problem_ = covariance_stage();
  Eigen::MatrixXd variance_ = problem_.W.cwiseInverse();
  double N_ = static_cast<double>(problem_.G.cols());
  FrfEstimate frf_;
};

TEST_F(Covariance, OfMaximumLikelihoodIsTheInverseFisherMatrix) {
  measure(31);
  expect_dense(Weighting::noise_variance, variance_);
  frf_.total_variance = variance_;
  frf_.noise_variance.resize(0, 0);
  expect_dense(Weighting::total_variance, variance_);
}

TEST_F(Covariance, OfOtherWeightsIsTheSandwich) {
  measure(32);
  for (const Weighting weighting :
       {Weighting::relative, Weighting::inverse_magnitude, Weighting::unit})
    expect_dense(weighting, variance_);
}

// Nonlinear distortion scatters from realization to realization, and only the total variance has it.
TEST_F(Covariance, OfOtherWeightsTakesTheTotalVarianceWhereThereIsOne) {
  measure(36);
  frf_.noise_variance = 0.1 * variance_;
  frf_.total_variance = variance_;
  expect_dense(Weighting::relative, variance_);
}

// The scatter of weights from variances with few degrees of freedom raises the covariance.
TEST_F(Covariance, OfEstimatedVariancesCountsTheScatterOfTheWeights) {
  test::RandomNumbers random(37);
  frf_ = noisy_frf(random, problem_, variance_);
  frf_.noise_dof = 9.0;
  for (double& value : frf_.noise_variance.reshaped()) value *= random.chi_square_mean(9.0);
  expect_dense(Weighting::noise_variance,
               test::values(weighed_variance(frf_, Weighting::noise_variance)));
}

TEST_F(Covariance, WithoutVariancesIsScaledByTheResidual) {
  test::RandomNumbers random(33);
  frf_ = noisy_frf(random, problem_, 1e-4 * problem_.G.cwiseAbs2());
  frf_.noise_variance.resize(0, 0);
  const FitResult relative = fit(Weighting::relative);
  ASSERT_TRUE(relative.trustworthy()) << relative.message();
  const Eigen::MatrixXd W = frf_.response.cwiseAbs2().cwiseInverse();
  expect_dense(relative, W, residual_over_degrees(relative) * W.cwiseInverse());
}

TEST_F(Covariance, IsRaisedAndSaidSoWhereTheModelDoesNotExplainTheData) {
  measure(34, 4.0);
  const FitResult raised = fit(Weighting::noise_variance);
  ASSERT_FALSE(raised.decisions.empty());
  EXPECT_THAT(raised.decisions.back(), testing::HasSubstr("does not explain the data"));
  const double scale = residual_over_degrees(raised);
  EXPECT_NEAR(scale, 4.0, 4.0 * 4.0 / std::sqrt(6.0 * N_));  // four standard deviations
  expect_dense(raised, problem_.W, scale * variance_);
}

// Outputs that a disturbance moves together, Cov(vec G) = (input part) kron C_E: the covariance includes this
// correlation, diagonal weights do not.
TEST_F(Covariance, CountsTheCorrelationOfTheOutputs) {
  test::RandomNumbers random(35);
  const std::complex<double> rho(0.6, 0.55);  // E e_1 conj(e_2) over the deviations
  frf_ = test::frf_of(problem_);
  for (Eigen::Index k = 0; k < frf_.lines(); ++k)
    for (Eigen::Index u = 0; u < 3; ++u) {
      const std::complex<double> first = random.circular();
      const std::complex<double> second =
          std::conj(rho) * first + std::sqrt(1.0 - std::norm(rho)) * random.circular();
      frf_.response(2 * u, k) += std::sqrt(variance_(2 * u, k)) * first;
      frf_.response(2 * u + 1, k) += std::sqrt(variance_(2 * u + 1, k)) * second;
    }
  frf_.noise_variance = variance_;
  // Any scale, because only the correlation is used.
  frf_.residual_covariance.resize(4, frf_.lines());
  const double a = 3.0;
  const double b = 0.2;
  frf_.residual_covariance.colwise() =  // (2,1) before (1,2): columns are stacked
      Eigen::Vector4cd(a * a, a * b * std::conj(rho), a * b * rho, b * b);
  const FitResult found = fit(Weighting::noise_variance);
  ASSERT_TRUE(found.trustworthy()) << found.message();

  const Eigen::MatrixXcd J = dense_jacobian(problem_, found);
  const Eigen::VectorXd W = problem_.W.reshaped();
  const Eigen::VectorXd deviation = variance_.reshaped().cwiseSqrt();
  // C W J for the C of every line and input: pairs of rows.
  Eigen::MatrixXcd CWJ(J.rows(), J.cols());
  for (Eigen::Index row = 0; row < J.rows(); row += 2) {
    const Eigen::RowVectorXcd one = deviation[row] * W[row] * J.row(row);
    const Eigen::RowVectorXcd two = deviation[row + 1] * W[row + 1] * J.row(row + 1);
    CWJ.row(row) = deviation[row] * (one + rho * two);
    CWJ.row(row + 1) = deviation[row + 1] * (std::conj(rho) * one + two);
  }
  const Eigen::MatrixXd C = sandwich(J, W, CWJ);
  expect_uncertainty(found, J, C);
  const Eigen::MatrixXd without = dense_covariance(J, problem_.W, variance_);
  const auto modes = Eigen::seqN(1, 3, 2);  // a_2 of each
  const Eigen::ArrayXd ratio = C.diagonal()(modes).array() / without.diagonal()(modes).array();
  EXPECT_GT((ratio.sqrt() - 1.0).abs().maxCoeff(), 0.05)
      << "a correlation that changes nothing tests nothing";
}

TEST_F(Covariance, IsNotComputedUnlessAsked) {
  FitOptions options = options_with(Weighting::relative);
  options.uncertainty = false;
  const FitResult bare = fit_additive_model(test::frf_of(problem_), problem_.model, options);
  EXPECT_EQ(bare.response_variance.size(), 0);
  EXPECT_TRUE(bare.model.submodels[1].numerator_std.empty());
  EXPECT_FALSE(bare.model.submodels[1].natural_frequency_std_hz.has_value());
}

// A pole that the fit holds at a guess is not known better than a free one, so what others owe to it stays uncertain.
TEST(ParameterCovariance, AGuessedPoleCountsAsUnknown) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(3);
  const FrfEstimate frf = noisy_frf(random, problem, problem.W.cwiseInverse());
  const FitOptions options = options_with(Weighting::noise_variance);
  const FitResult free = fit_additive_model(frf, problem.model, options);
  ASSERT_TRUE(free.trustworthy()) << free.message();
  const auto held = [&](HeldPole as) {
    AdditiveModel model = free.model;
    Submodel& mode = model.submodels.back();  // one of a close pair
    mode.held = as;
    return fit_additive_model(frf, model, options);
  };
  const FitResult guessed = held(HeldPole::guess);
  const FitResult known = held(HeldPole::pole);
  double least = 1.0;
  for (std::size_t i = 0; i < free.model.submodels.size(); ++i) {
    const Submodel& one = free.model.submodels[i];
    const Submodel& other = guessed.model.submodels[i];
    for (std::size_t m = 0; m < one.numerator_std.size(); ++m) {
      EXPECT_LT((other.numerator_std[m] - one.numerator_std[m]).norm(),
                1e-5 * one.numerator_std[m].norm());
      least = std::min(
          least, (known.model.submodels[i].numerator_std[m].array() / one.numerator_std[m].array())
                     .minCoeff());
    }
    if (!one.is_mode()) continue;
    EXPECT_EQ(other.natural_frequency_std_hz.has_value(), i + 1 < free.model.submodels.size());
    if (!other.natural_frequency_std_hz) continue;
    EXPECT_NEAR(*other.natural_frequency_std_hz / one.natural_frequency_std_hz.value(), 1.0, 1e-5);
  }
  EXPECT_LT(least, 0.95);  // it matters here
}

}  // namespace stageid::test_parameter_covariance
