// Weight matrices: their construction, and rejected ones.

#include "estimation/problem/weight_matrices.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "estimation/problem/fit_problem.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "tests/estimation/correlated_stage.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_weight_matrices {

using test::correlated_noise;
using test::CorrelatedNoise;
using test::DenseProblem;
using test::RandomNumbers;
using testing::AllOf;
using testing::HasSubstr;

DenseProblem stage() { return test::noisy_stage(HoldModel::none, 0.0); }

/// W_k read off, column by column.
Eigen::MatrixXcd matrix_of(const WeightMatrices& weights, Eigen::Index k, Eigen::Index n_c) {
  Eigen::MatrixXcd out(n_c, n_c);
  for (Eigen::Index c = 0; c < n_c; ++c) {
    Eigen::MatrixXcd unit = Eigen::VectorXcd::Unit(n_c, c);
    weights.apply(k, unit);
    out.col(c) = unit;
  }
  return out;
}

TEST(WeightMatrices, OfALikelihoodInvertTheKroneckerProduct) {
  const DenseProblem problem = stage();
  const CorrelatedNoise noise = correlated_noise(problem, 0.01, 0.9);
  RandomNumbers random(1);
  const FrfEstimate frf = test::measured(problem, noise, random);
  const WeightMatrices weights = WeightMatrices::likelihood(frf);
  EXPECT_EQ(weights.scatter_factor(), 1.0);
  for (const Eigen::Index k : {0, 57, 399}) {
    const Eigen::MatrixXcd C = noise.covariance(static_cast<std::size_t>(k));
    const Eigen::MatrixXcd unit = matrix_of(weights, k, 6) * C;
    // Condition of C: about (1.9 / 0.1)^2 and the scales' 100.
    EXPECT_LT((unit - Eigen::MatrixXcd::Identity(6, 6)).cwiseAbs().maxCoeff(), 1e-11);
    for (Eigen::Index c = 0; c < 6; ++c)
      EXPECT_NEAR(weights.marginal()(c, k) * C(c, c).real(), 1.0, 1e-12);
  }
}

TEST(WeightMatrices, OfAUserAreTakenAsTheyAre) {
  const DenseProblem problem = stage();
  const CorrelatedNoise noise = correlated_noise(problem, 0.01, 0.9);
  const FrfEstimate frf = test::frf_of(problem);
  FitOptions options = test::fit_options(Weighting::user);
  options.user_weight_matrices.resize(36, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    options.user_weight_matrices.col(k) =
        inverse(noise.covariance(static_cast<std::size_t>(k))).reshaped();
  // Singular ones are allowed: a line that does not count, a channel, a difference of two.
  options.user_weight_matrices.col(3).setZero();
  const Eigen::VectorXcd difference{{1.0, -1.0, 0.0, 0.0, 0.0, 0.0}};
  options.user_weight_matrices.col(4) = (difference * difference.adjoint()).reshaped();
  const auto weights = make_weight_matrices(frf, options);
  ASSERT_TRUE(weights.has_value());
  for (const Eigen::Index k : {0, 4, 200})
    EXPECT_EQ(matrix_of(*weights, k, 6).reshaped(), options.user_weight_matrices.col(k));
  EXPECT_EQ(weights->marginal().col(3), Eigen::VectorXd::Zero(6));
  EXPECT_EQ(weights->marginal().col(4), difference.cwiseAbs());
  const Eigen::MatrixXcd C = noise.covariance(200);
  EXPECT_NEAR(weights->marginal()(5, 200) * C(5, 5).real(), 1.0, 1e-10);
  EXPECT_EQ(*make_weights(frf, options), weights->marginal());
}

TEST(WeightMatrices, AreNoneWithDiagonalWeights) {
  FitOptions options;
  for (const Weighting weighting : {Weighting::unit, Weighting::relative, Weighting::user}) {
    options.weighting = weighting;
    EXPECT_FALSE(make_weight_matrices(test::frf_of(stage()), options).has_value());
  }
}

// E{C_hat^-1} = nu / (nu - n) C^-1, infinite for nu <= n: after smoothing the mean of the weights is
// C^-1, and E{W C W} is scatter_factor() times it, whatever nu.
TEST(WeightMatrices, FromFewDegreesOfFreedomAreUnbiased) {
  constexpr Eigen::Index kOutputs = 3;
  constexpr Eigen::Index kLines = 4000;
  for (const int dof : {1, 2, 5, 20, 26, 60}) {
    RandomNumbers random(static_cast<std::uint64_t>(40 + dof));
    const Eigen::MatrixXcd C = test::correlated_matrix(random, kOutputs, 0.8);
    FrfEstimate frf;
    frf.outputs.names = {"z1", "z2", "z3"};
    frf.inputs.names = {"a1"};
    frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 1.0, 4000.0);
    frf.response.setOnes(kOutputs, kLines);
    frf.input_factor.setOnes(1, kLines);
    frf.noise_dof = dof;
    frf.residual_covariance.resize(9, kLines);
    const Eigen::MatrixXcd L = test::cholesky(C);
    for (Eigen::Index k = 0; k < kLines; ++k) {
      const Eigen::MatrixXcd samples = test::circular_matrix(random, kOutputs, dof);
      // The level drifts: 1 over the band, little over a window.
      const Eigen::MatrixXcd scaled = std::exp(0.00025 * static_cast<double>(k)) * L * samples;
      const Eigen::MatrixXcd estimate = scaled * scaled.adjoint() / static_cast<double>(dof);
      frf.residual_covariance.col(k) = estimate.reshaped();
    }
    const WeightMatrices weights = WeightMatrices::likelihood(frf);
    Eigen::MatrixXcd first = Eigen::MatrixXcd::Zero(kOutputs, kOutputs);
    Eigen::MatrixXcd second = first;
    for (Eigen::Index k = 0; k < kLines; ++k) {
      const double level = std::exp(0.0005 * static_cast<double>(k));
      const Eigen::MatrixXcd W = L.adjoint() * matrix_of(weights, k, kOutputs) * L * level;
      first += W / static_cast<double>(kLines);
      second += W * W / static_cast<double>(kLines);
    }
    const Eigen::MatrixXcd unit = Eigen::MatrixXcd::Identity(kOutputs, kOutputs);
    // Relative scatter of an entry 1/5, one independent value every 28 lines (dof 1): 1.7 %; the
    // smoothed variances add a few per cent where they come from one degree of freedom.
    EXPECT_LT((first - unit).cwiseAbs().maxCoeff(), 0.06) << dof;
    EXPECT_LT((second - weights.scatter_factor() * unit).cwiseAbs().maxCoeff(), 0.15) << dof;
  }
}

struct WeightMatrixRefusal : testing::Test {
  WeightMatrixRefusal() {
    RandomNumbers random(1);
    frf_ = test::measured(problem_, correlated_noise(problem_, 0.01, 0.9), random);
    options_.weighting = Weighting::likelihood;
  }
  void expect_refused(const std::string& part, const std::string& other = "") {
    EXPECT_THAT(test::error_message<std::invalid_argument>(
                    [this] { make_weight_matrices(frf_, options_); }),
                AllOf(HasSubstr(part), HasSubstr(other)));
  }
  void ask_for_matrices() {
    options_.weighting = Weighting::user;
    const Eigen::MatrixXcd unit = Eigen::MatrixXcd::Identity(6, 6);
    options_.user_weight_matrices = unit.reshaped().replicate(1, frf_.lines());
  }
  DenseProblem problem_ = stage();
  FrfEstimate frf_;
  FitOptions options_;
};

TEST_F(WeightMatrixRefusal, AnFrfWithoutOneOfTheFactors) {
  const FrfEstimate whole = frf_;
  frf_.input_factor.resize(0, 0);
  expect_refused("needs /input_factor in the FRF", "stageid frf");
  frf_ = whole;
  frf_.residual_covariance.resize(0, 0);
  expect_refused("needs /residual_covariance in the FRF", "two periods");
}

TEST_F(WeightMatrixRefusal, FactorsThatAreNotOfFullRankOrNotHermitian) {
  const FrfEstimate whole = frf_;
  frf_.residual_covariance(3, 7) = 0.0;
  expect_refused("residual_covariance of z2 on line 7");
  frf_ = whole;
  frf_.residual_covariance.col(9).setOnes();
  expect_refused("residual_covariance of line 9", "exclude one of them");
  frf_ = whole;
  frf_.input_factor.col(11).setOnes();
  expect_refused("input_factor of line 11", "exclude one of them");
  frf_ = whole;
  frf_.input_factor(1, 12) *= 2.0;
  expect_refused("input_factor of line 12", "Hermitian");
}

TEST_F(WeightMatrixRefusal, TooFewDegreesOfFreedomInAll) {
  frf_.noise_dof = 1.0;
  frf_ = select_band(frf_, frf_.frequency_hz[0], frf_.frequency_hz[2]);
  expect_refused("3 degrees of freedom", "needs 4");
}

TEST_F(WeightMatrixRefusal, OfAUser) {
  Eigen::MatrixXcd& given = options_.user_weight_matrices;
  ask_for_matrices();
  given(5, 20) = std::nan("");
  expect_refused("line 20", "not finite");
  ask_for_matrices();
  given(5, 21) = std::complex<double>(0.0, 1e-6);
  expect_refused("line 21", "not Hermitian");
  ask_for_matrices();
  given(0, 22) = -1e-6;
  expect_refused("line 22", "not positive semidefinite");
  ask_for_matrices();
  // Positive diagonal, but 1 - 1.1 along the difference of two channels.
  given(1, 23) = given(6, 23) = 1.1;
  expect_refused("line 23", "not positive semidefinite");
  given.setZero();
  expect_refused("all are zero");
  given.conservativeResize(36, frf_.lines() - 1);
  expect_refused("shape");
}

TEST(WeightMatrices, OfAUserMustFitInMemory) {
  EXPECT_NO_THROW(require_memory_for_weight_matrices(52, 4000));
  EXPECT_THAT(test::error_message<std::invalid_argument>(
                  [] { require_memory_for_weight_matrices(221, 4000); }),
              AllOf(HasSubstr("2.9 GiB"), HasSubstr("likelihood")));
}

}  // namespace stageid::test_weight_matrices
