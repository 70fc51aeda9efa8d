#include "frf/response/distortion_variance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_distortion_variance {

constexpr Eigen::Index kLines = 400;

/// A plant that falls by 80 dB, with flat noise and a distortion proportional to the response; the variances are those
/// of M realizations of P periods.
struct Case {
  Eigen::MatrixXd truth;  ///< of the mean of the realizations
  FrfEstimate frf;
};

Case draw(std::uint64_t seed, int M, double relative_distortion) {
  test::RandomNumbers random(seed);
  Case out;
  FrfEstimate& frf = out.frf;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 10.0, 1000.0);
  frf.inputs.names = {"a"};
  frf.outputs.names = {"z"};
  frf.response.resize(1, kLines);
  out.truth.resize(1, kLines);
  constexpr double kNoise = 1e-14;
  constexpr int kNoiseDof = 20;
  for (Eigen::Index k = 0; k < kLines; ++k) {
    const double response = std::pow(frf.frequency_hz[k], -2.0);
    frf.response(0, k) = response;
    out.truth(0, k) = (std::pow(relative_distortion * response, 2) + kNoise) / M;
  }
  frf.total_dof = M - 1.0;
  frf.noise_dof = kNoiseDof;
  const auto estimated = [&](double variance, int dof) {
    return variance * test::circular_matrix(random, dof, 1).squaredNorm() / dof;
  };
  frf.noise_variance.resize(1, kLines);
  frf.total_variance.resize(1, kLines);
  for (Eigen::Index k = 0; k < kLines; ++k) {
    frf.noise_variance(0, k) = estimated(kNoise / M, kNoiseDof);
    frf.total_variance(0, k) = estimated(out.truth(0, k), M - 1);
  }
  return out;
}

/// Cost of weights 1/v: the variance of a weighted mean over that with the true variance, minus 1.
double loss(const Eigen::MatrixXd& variance, const Eigen::MatrixXd& truth) {
  const Eigen::ArrayXd w = variance.row(0).transpose().array().inverse();
  const Eigen::ArrayXd v = truth.row(0).transpose().array();
  return (w.square() * v).sum() / std::pow(w.sum(), 2) * v.inverse().sum() - 1.0;
}

TEST(DistortionVariance, IsNearTheTruthWithTwoRealizations) {
  for (const double distortion : {0.0, 1e-3, 0.03, 0.3})
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const Case drawn = draw(seed, 2, distortion);
      const DistortionVariance found = distortion_variance(drawn.frf);
      EXPECT_EQ(found.dof, 9.0);
      const Eigen::ArrayXXd ratio = found.variance.array() / drawn.truth.array();
      EXPECT_NEAR(ratio.mean(), 1.0, 0.15) << distortion << ", seed " << seed;
      EXPECT_LT(ratio.log().abs().mean(), 0.35) << distortion << ", seed " << seed;
      EXPECT_LT(loss(found.variance, drawn.truth), 0.1) << distortion << ", seed " << seed;
    }
}

TEST(DistortionVariance, IsTheTotalVarianceOfManyRealizations) {
  const Case drawn = draw(5, 1000, 0.03);
  const DistortionVariance found = distortion_variance(drawn.frf);
  EXPECT_LT((found.variance.array() / drawn.frf.total_variance.array() - 1.0).abs().maxCoeff(),
            0.01);
}

// An octave without response has no distortion proportional to it.
TEST(DistortionVariance, AnOutputThatShowsNothingHasItsNoise) {
  Case drawn = draw(6, 3, 0.0);
  drawn.frf.response.setZero();
  const DistortionVariance found = distortion_variance(drawn.frf);
  EXPECT_TRUE(found.variance.allFinite());
  EXPECT_GT(found.variance.minCoeff(), 0.0);
}

// A force error of the actuator that drives a mode moves the output also while the other actuator is excited, which
// hardly drives that mode.
TEST(DistortionVariance, OfAWeaklyDrivenModeIsThatOfItsStrongActuator) {
  test::RandomNumbers random(11);
  FrfEstimate frf;
  frf.inputs.names = {"strong", "weak"};
  frf.outputs.names = {"z"};
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 10.0, 1000.0);
  frf.response.resize(2, kLines);
  frf.total_variance.resize(2, kLines);
  frf.noise_variance.setConstant(2, kLines, 1e-12);
  frf.total_dof = 1.0;
  frf.noise_dof = 20.0;
  Eigen::VectorXd truth(kLines);
  for (Eigen::Index k = 0; k < kLines; ++k) {
    const double ratio = frf.frequency_hz[k] / 400.0;
    const std::complex<double> mode = 1.0 / std::complex<double>(1.0 - ratio * ratio, 0.02 * ratio);
    frf.response.col(k) << mode, 1.0 + 0.01 * mode;
    truth[k] = 1e-12 + 1e-4 * frf.response.col(k).squaredNorm();
    for (Eigen::Index u = 0; u < 2; ++u)
      frf.total_variance(u, k) = truth[k] * std::norm(random.circular());
  }
  const DistortionVariance found = distortion_variance(frf);
  Eigen::Index peak = 0;
  truth.maxCoeff(&peak);
  for (Eigen::Index u = 0; u < 2; ++u) {
    const Eigen::VectorXd ratio = found.variance.row(u)
                                      .segment(peak - 4, 9)
                                      .transpose()
                                      .cwiseQuotient(truth.segment(peak - 4, 9));
    EXPECT_NEAR(ratio.mean(), 1.0, 0.3) << "input " << u;
  }
}

// Forces that differ from realization to realization: y = G (u + d) + v has the covariance C_E + s G G^H.
TEST(DistortionVariance, OfForcesIsCorrelatedBetweenTheOutputsAsTheResponseIs) {
  test::RandomNumbers random(8);
  constexpr Eigen::Index kOutputs = 3, kInputs = 2, kFew = 5;
  FrfEstimate frf;
  frf.outputs.names.resize(kOutputs);
  frf.inputs.names.resize(kInputs);
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(kFew, 10.0, 50.0);
  frf.response = test::circular_matrix(random, kOutputs * kInputs, kFew);
  frf.noise_variance.resize(kOutputs * kInputs, kFew);
  frf.residual_covariance.resize(kOutputs * kOutputs, kFew);
  Eigen::MatrixXd variance(kOutputs * kInputs, kFew);
  Eigen::MatrixXcd expected(kOutputs * kOutputs, kFew);
  for (Eigen::Index k = 0; k < kFew; ++k) {
    const Eigen::MatrixXcd root = test::circular_matrix(random, kOutputs, kOutputs);
    const Eigen::MatrixXcd C_E = root * root.adjoint();
    frf.residual_covariance.col(k) = C_E.reshaped();
    frf.noise_variance.col(k) = C_E.diagonal().real().replicate(kInputs, 1);
    const Eigen::MatrixXcd G = frf.response.col(k).reshaped(kOutputs, kInputs);
    const Eigen::MatrixXcd C = C_E + 0.3 * static_cast<double>(k) * G * G.adjoint();
    expected.col(k) = C.reshaped();
    variance.col(k) = C.diagonal().real().replicate(kInputs, 1);
  }
  EXPECT_TRUE(covariance_with_distortion(frf, variance).isApprox(expected, 1e-12));
}

}  // namespace stageid::test_distortion_variance
