// The uncertainty reported by a fit, compared with repeated measurements.

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/request/fit_request.hpp"
#include "tests/estimation/covariance_stage.hpp"
#include "tests/estimation/repeated_fits.hpp"

namespace stageid::test_covariance_monte_carlo {

using test::covariance_stage;
using test::DenseProblem;
using test::kRuns;
using test::options_with;

/// Fits noisy measurements. Checks the scatter relative to the reported deviations, also of the response.
void expect_honest(Weighting weighting, const Eigen::MatrixXd& variance, bool tell_variance) {
  const DenseProblem problem = covariance_stage();
  test::RandomNumbers random(77);
  const test::RepeatedFits fits =
      test::repeat_fits(problem, options_with(weighting), [&](std::uint64_t) {
        FrfEstimate frf = test::noisy_frf(random, problem, variance);
        if (!tell_variance) frf.noise_variance.resize(0, 0);
        return frf;
      });
  test::expect_honest(fits.scatter, fits.reported);
  for (Eigen::Index q = 0; q < 6; ++q) {
    // Unbiased within the scatter of the mean.
    const Submodel& truth = problem.model.submodels[q / 2 + 1];
    EXPECT_NEAR(fits.mean[q], q % 2 == 0 ? truth.natural_frequency_hz() : truth.damping_ratio(),
                4.0 * std::sqrt(fits.reported[q] / kRuns));
  }
  EXPECT_NEAR(fits.mean_response_ratio(), 1.0, 4.0 * fits.response_ratio_error());
  // A channel has 4 numerators and a share of the poles: about 8 real degrees a run.
  for (const double ratio : fits.response_ratio.rowwise().mean())
    EXPECT_NEAR(ratio, 1.0, 4.0 * std::sqrt(2.0 / (8.0 * kRuns)) * 1.5);
}

TEST(CovarianceMonteCarlo, MaximumLikelihood) {
  expect_honest(Weighting::noise_variance, covariance_stage().W.cwiseInverse(), true);
}

TEST(CovarianceMonteCarlo, RelativeWeightsWithKnownVariance) {
  const DenseProblem problem = covariance_stage();
  // A floor that is high where the response is low: relative weights are wrong for it.
  const double floor = 0.02 * problem.G.cwiseAbs().reshaped().minCoeff();
  const Eigen::MatrixXd variance =
      1e-6 * problem.G.cwiseAbs2() +
      Eigen::MatrixXd::Constant(problem.G.rows(), problem.G.cols(), floor * floor);
  expect_honest(Weighting::relative, variance, true);
}

TEST(CovarianceMonteCarlo, RelativeWeightsWithUnknownVariance) {
  expect_honest(Weighting::relative, 1e-5 * covariance_stage().G.cwiseAbs2(), false);
}

// What differs from realization to realization acts as forces: the errors of the outputs follow the response together.
// Taken for independent, they would give half of the variance.
TEST(CovarianceMonteCarlo, DistortionOfFewRealizations) {
  const DenseProblem problem = covariance_stage();
  constexpr Eigen::Index kOutputs = 2, kInputs = 3;
  constexpr int kRealizations = 4;
  constexpr double kDistortion = 0.02;  // of one realization
  test::RandomNumbers random(78);
  FitRequest request;
  request.weighting = Weighting::total_variance;
  request.delay = DelayRequest{DelayModel::estimate, 0.0};
  Eigen::MatrixXd values(3, kRuns);
  Eigen::Vector3d reported = Eigen::Vector3d::Zero();
  for (int run = 0; run < kRuns; ++run) {
    FrfEstimate frf = test::frf_of(problem);
    const double noise = 1e-6 * problem.G.cwiseAbs().minCoeff();
    std::vector<Eigen::MatrixXcd> responses(kRealizations, problem.G);
    for (Eigen::MatrixXcd& G : responses)
      for (Eigen::Index k = 0; k < G.cols(); ++k) {
        const Eigen::MatrixXcd force =
            kDistortion * test::circular_matrix(random, kInputs, kInputs);
        const Eigen::MatrixXcd exact = problem.G.col(k).reshaped(kOutputs, kInputs);
        G.col(k) += (exact * force).reshaped();
      }
    frf.response.setZero();
    for (const Eigen::MatrixXcd& G : responses) frf.response += G / kRealizations;
    frf.total_variance.setZero(frf.response.rows(), frf.response.cols());
    for (const Eigen::MatrixXcd& G : responses)
      frf.total_variance += (G - frf.response).cwiseAbs2() / (kRealizations * (kRealizations - 1));
    frf.noise_variance.setConstant(frf.response.rows(), frf.response.cols(), noise * noise);
    frf.residual_covariance = (noise * noise * Eigen::MatrixXcd::Identity(kOutputs, kOutputs))
                                  .reshaped()
                                  .replicate(1, frf.response.cols());
    frf.realizations = kRealizations;
    frf.total_dof = kRealizations - 1.0;
    FitSetup setup = make_fit_setup(request, std::move(frf));
    setup.options.hold = problem.hold;
    setup.options.delay_s = 1.37e-4;
    setup.options.threads = 1;
    const FitResult fit = fit_additive_model(setup.frf, problem.model, setup.options);
    for (Eigen::Index i = 0; i < 3; ++i) {
      const Submodel& s = fit.model.submodels[i + 1];
      values(i, run) = s.natural_frequency_hz();
      reported[i] += std::pow(*s.natural_frequency_std_hz, 2) / kRuns;
    }
  }
  test::expect_honest(test::scatter_of(values), reported);
}

}  // namespace stageid::test_covariance_monte_carlo
