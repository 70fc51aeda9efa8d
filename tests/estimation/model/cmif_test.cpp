#include "estimation/model/cmif.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "excitation/decompositions/decompositions.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_cmif {

using testing::ElementsAre;

/// 1 / (s^2 + 2 zeta omega s + omega^2) at the line.
std::complex<double> resonance(double line_hz, double mode_hz, double damping) {
  const std::complex<double> s(0.0, 2.0 * std::numbers::pi * line_hz);
  const double omega = 2.0 * std::numbers::pi * mode_hz;
  return 1.0 / (s * s + 2.0 * damping * omega * s + omega * omega);
}

FrfEstimate empty_frf(int outputs, int inputs, Eigen::Index lines, double low, double high) {
  test::DenseProblem problem;
  problem.model = test::named_model(outputs, inputs);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(lines, low, high);
  problem.G = Eigen::MatrixXcd::Zero(outputs * inputs, lines);
  return test::frf_of(problem);
}

/// Adds a mode with shapes phi, psi (not damped alike: numbers as given).
void add_mode(FrfEstimate& frf, double mode_hz, double damping, const Eigen::VectorXd& phi,
              const Eigen::VectorXd& psi) {
  const Eigen::MatrixXd residue = phi * psi.transpose();
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    frf.response.col(k) += residue.reshaped().cast<std::complex<double>>() *
                           resonance(frf.frequency_hz[k], mode_hz, damping);
}

TEST(Cmif, AcceleranceIsOmegaSquaredAndWhitenedIsOverTheDeviation) {
  FrfEstimate frf = empty_frf(1, 1, 3, 10.0, 30.0);
  frf.response << std::complex<double>(3.0, 4.0), 2.0, 1.0;
  const Eigen::MatrixXd accelerance = cmif(frf, CmifKind::accelerance);
  const double omega = 2.0 * std::numbers::pi * 20.0;
  EXPECT_NEAR(accelerance(0, 1), 4.0 * std::pow(omega, 4), 1e-12 * 4.0 * std::pow(omega, 4));
  frf.total_variance = Eigen::MatrixXd::Constant(1, 3, 100.0);
  EXPECT_NEAR(cmif(frf, CmifKind::whitened)(0, 0), 0.25, 1e-15);
  frf.noise_variance = Eigen::MatrixXd::Constant(1, 3, 25.0);  // goes before total
  EXPECT_NEAR(cmif(frf, CmifKind::whitened)(0, 0), 1.0, 1e-15);
  EXPECT_THAT(test::error_message<std::invalid_argument>(
                  [] { cmif(empty_frf(1, 1, 3, 1.0, 3.0), CmifKind::whitened); }),
              testing::HasSubstr("variances"));
}

TEST(Cmif, HasAsManyCurvesAsTheSmallerSide) {
  EXPECT_EQ(cmif(empty_frf(4, 13, 3, 1.0, 3.0)).rows(), 4);
  EXPECT_EQ(cmif(empty_frf(5, 2, 3, 1.0, 3.0)).rows(), 2);
  EXPECT_EQ(cmif(empty_frf(1, 3, 3, 1.0, 3.0)).rows(), 1);
}

/// With orthonormal columns.
Eigen::MatrixXcd orthonormal(Eigen::Index rows, Eigen::Index columns, test::RandomNumbers& random) {
  return svd(test::circular_matrix(random, rows, columns), Eigen::ComputeThinU).matrixU();
}

// G = U S V^H with known S over six decades, one of them zero on a line: the squares of eigenvalues would lose half of
// the digits. A singular value has an absolute error of eps times the largest.
TEST(Cmif, IsTheSquaresOfTheSingularValuesLargestFirst) {
  FrfEstimate frf = empty_frf(3, 4, 20, 1.0, 20.0);
  test::RandomNumbers random(3);
  Eigen::Matrix3Xd S(3, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    S.col(k) << 2.0 + random.uniform(), 1e-3 * (1.0 + random.uniform()), 1e-6 * random.uniform();
    if (k == 7) S(2, k) = 0.0;
    const Eigen::MatrixXcd G = orthonormal(3, 3, random) *
                               S.col(k).cast<std::complex<double>>().asDiagonal() *
                               orthonormal(4, 3, random).adjoint();
    frf.response.col(k) = G.reshaped();
  }
  const Eigen::MatrixXd curves = cmif(frf);
  const Eigen::MatrixXd accelerance = cmif(frf, CmifKind::accelerance);
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const double omega = 2.0 * std::numbers::pi * frf.frequency_hz[k];
    for (Eigen::Index i = 0; i < 3; ++i) {
      EXPECT_NEAR(std::sqrt(curves(i, k)), S(i, k), 1e-14 * S(0, k));
      EXPECT_NEAR(std::sqrt(accelerance(i, k)) / (omega * omega), S(i, k), 1e-14 * S(0, k));
    }
  }
}

std::vector<double> frequencies(const std::vector<ModeCandidate>& modes) {
  std::vector<double> out;
  for (const ModeCandidate& mode : modes) out.push_back(mode.frequency_hz);
  return out;
}

TEST(PickModes, FindsTheModesAndTheirDampingByTheHalfPowerWidth) {
  FrfEstimate frf = empty_frf(2, 3, 4000, 10.0, 1000.0);
  add_mode(frf, 150.0, 0.01, Eigen::Vector2d(1.0, 0.4), Eigen::Vector3d(1.0, -1.0, 0.5));
  add_mode(frf, 420.0, 0.006, Eigen::Vector2d(-0.3, 1.0), Eigen::Vector3d(0.2, 1.0, 1.0));
  add_mode(frf, 810.0, 0.02, Eigen::Vector2d(1.0, 1.0), Eigen::Vector3d(1.0, 0.3, -1.0));
  const std::vector<ModeCandidate> modes = pick_modes(frf);
  ASSERT_THAT(frequencies(modes),
              ElementsAre(testing::DoubleNear(150.0, 0.5), testing::DoubleNear(420.0, 0.5),
                          testing::DoubleNear(810.0, 1.0)));
  // The neighbours' slopes shift the half-power points a little.
  EXPECT_NEAR(modes[0].damping_ratio, 0.01, 0.001);
  EXPECT_NEAR(modes[1].damping_ratio, 0.006, 0.0006);
  EXPECT_NEAR(modes[2].damping_ratio, 0.02, 0.002);
  for (const ModeCandidate& mode : modes) EXPECT_EQ(mode.cmif_curve, 1);
}

TEST(PickModes, ARepeatedModeShowsInTheSecondCurve) {
  FrfEstimate frf = empty_frf(2, 2, 2000, 100.0, 600.0);
  add_mode(frf, 300.0, 0.01, Eigen::Vector2d(1.0, 0.0), Eigen::Vector2d(1.0, 0.0));
  add_mode(frf, 300.5, 0.01, Eigen::Vector2d(0.0, 1.0), Eigen::Vector2d(0.0, 0.7));
  const std::vector<ModeCandidate> modes = pick_modes(frf);
  ASSERT_EQ(modes.size(), 2U);
  EXPECT_NEAR(modes[0].frequency_hz, 300.0, 0.6);
  EXPECT_NEAR(modes[1].frequency_hz, 300.5, 0.6);
  EXPECT_EQ(modes[0].cmif_curve + modes[1].cmif_curve, 3);
}

// Two modes of different direction: their curves cross between them, where the second curve has a peak that is not a
// mode.
TEST(PickModes, ACrossingIsNotAMode) {
  FrfEstimate frf = empty_frf(2, 2, 4000, 50.0, 800.0);
  add_mode(frf, 200.0, 0.01, Eigen::Vector2d(1.0, 0.05), Eigen::Vector2d(1.0, 0.05));
  add_mode(frf, 500.0, 0.01, Eigen::Vector2d(-0.05, 1.0), Eigen::Vector2d(0.05, 1.0));
  const Eigen::MatrixXd curves = cmif(frf, CmifKind::accelerance);
  Eigen::Index lowest = 0;
  const auto between = Eigen::seq(1000, 2200);  // 237 to 462 Hz
  curves(0, between).minCoeff(&lowest);
  EXPECT_GT(curves(1, 1000 + lowest), 0.3 * curves(0, 1000 + lowest)) << "there is no crossing";
  EXPECT_THAT(frequencies(pick_modes(frf)),
              ElementsAre(testing::DoubleNear(200.0, 0.5), testing::DoubleNear(500.0, 0.5)));
}

TEST(PickModes, TheRigidBodysSlopeHidesNothing) {
  FrfEstimate frf = empty_frf(1, 1, 3000, 5.0, 1500.0);
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const double omega = 2.0 * std::numbers::pi * frf.frequency_hz[k];
    frf.response(0, k) =
        -1.0 / (omega * omega) + 0.02 * resonance(frf.frequency_hz[k], 900.0, 0.01);
  }
  // As strong as the rigid body beside it: the sum peaks within half of the mode's width, 9 Hz.
  EXPECT_THAT(frequencies(pick_modes(frf)), ElementsAre(testing::DoubleNear(900.0, 9.0)));
}

TEST(PickModes, NoiseIsNotTakenForModes) {
  FrfEstimate frf = empty_frf(4, 5, 3000, 5.0, 1500.0);
  test::RandomNumbers random(12);
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const double omega = 2.0 * std::numbers::pi * frf.frequency_hz[k];
    for (Eigen::Index c = 0; c < 20; ++c) frf.response(c, k) = random.circular() / (omega * omega);
  }
  // 4 curves of 3000 lines have 4000 local maxima.
  EXPECT_LE(pick_modes(frf).size(), 8U);
}

TEST(PickModes, KeepsTheMostProminentWhereThereAreTooMany) {
  FrfEstimate frf = empty_frf(1, 1, 4000, 10.0, 1000.0);
  add_mode(frf, 200.0, 0.01, Eigen::VectorXd::Ones(1), Eigen::VectorXd::Constant(1, 30.0));
  add_mode(frf, 500.0, 0.01, Eigen::VectorXd::Ones(1), Eigen::VectorXd::Constant(1, 30.0));
  // No antiresonance above it: the mass of all three ends 14 dB below its peak.
  add_mode(frf, 800.0, 0.01, Eigen::VectorXd::Ones(1), Eigen::VectorXd::Constant(1, 10.0));
  EXPECT_EQ(pick_modes(frf).size(), 3U);
  PeakOptions two;
  two.most_peaks = 2;
  EXPECT_THAT(frequencies(pick_modes(frf, two)),
              ElementsAre(testing::DoubleNear(200.0, 1.0), testing::DoubleNear(500.0, 1.0)));
  PeakOptions prominent;
  prominent.minimum_prominence_db = 200.0;
  EXPECT_TRUE(pick_modes(frf, prominent).empty());
}

}  // namespace stageid::test_cmif
