#include "excitation/decompositions/decompositions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

namespace stageid::decompositions_test {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

/// Companion matrix of (x - 1)(x - 2)(x^2 + 4).
MatrixXd companion() {
  MatrixXd m = MatrixXd::Zero(4, 4);
  m.row(0) << 3.0, -6.0, 12.0, -8.0;
  m.diagonal(-1).setOnes();
  return m;
}

void expect_roots(Eigen::VectorXcd values) {
  std::ranges::sort(values, [](Complex a, Complex b) {
    return a.real() + 0.1 * a.imag() < b.real() + 0.1 * b.imag();
  });
  const Complex roots[] = {{0.0, -2.0}, {0.0, 2.0}, 1.0, 2.0};
  ASSERT_EQ(values.size(), 4);
  for (Eigen::Index i = 0; i < 4; ++i) EXPECT_NEAR(std::abs(values[i] - roots[i]), 0.0, 1e-13);
}

TEST(Decompositions, EigenvaluesAreTheRootsOfTheCompanionMatrix) {
  expect_roots(eigenvalues(companion()));
  expect_roots(eigenvalues(MatrixXcd(companion().cast<Complex>())));
}

TEST(Decompositions, BalancedEigenvaluesDoNotDependOnTheUnitsOfTheStates) {
  const Eigen::Vector4d units(1e-9, 3.0, 2e7, 1e-4);
  const MatrixXd m = units.asDiagonal() * companion() * units.cwiseInverse().asDiagonal();
  expect_roots(balanced_eigenvalues(m));
  MatrixXd broken = companion();
  broken(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(balanced_eigenvalues(broken).array().isNaN().all());
}

TEST(Decompositions, EigenvaluesThatDoNotConvergeAreNaN) {
  MatrixXd m = companion();
  m(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(eigenvalues(m).array().isNaN().all());
}

TEST(Decompositions, EigenvectorsBelongToTheirEigenvalues) {
  const MatrixXd m = companion();
  const auto eigen = general_eigen(m);
  const MatrixXcd V = eigen.eigenvectors();
  EXPECT_TRUE((m * V).isApprox(V * eigen.eigenvalues().asDiagonal(), 1e-12));
  expect_roots(eigen.eigenvalues());
}

TEST(Decompositions, SymmetricEigenvaluesIncrease) {
  MatrixXd m(2, 2);
  m << 2.0, 1.0, 1.0, 2.0;
  const auto eigen = symmetric_eigen(m);
  EXPECT_TRUE(eigen.eigenvalues().isApprox(Eigen::Vector2d(1.0, 3.0)));
  EXPECT_NEAR(std::abs(eigen.eigenvectors().col(1).sum()), std::sqrt(2.0), 1e-14);
  MatrixXcd hermitian(2, 2);
  hermitian << 2.0, Complex(0.0, 1.0), Complex(0.0, -1.0), 2.0;
  EXPECT_TRUE(hermitian_eigenvalues(hermitian).isApprox(Eigen::Vector2d(1.0, 3.0)));
}

TEST(Decompositions, SingularVectorsOfTheRequestedKind) {
  MatrixXd m(3, 2);
  m << 3.0, 0.0, 0.0, 4.0, 0.0, 0.0;
  EXPECT_TRUE(svd(m, 0).singularValues().isApprox(Eigen::Vector2d(4.0, 3.0)));
  const auto parts =
      svd(MatrixXcd(Complex(0.0, 1.0) * m), Eigen::ComputeThinU | Eigen::ComputeFullV);
  const MatrixXcd back =
      parts.matrixU() * parts.singularValues().asDiagonal() * parts.matrixV().adjoint();
  EXPECT_TRUE(back.isApprox(Complex(0.0, 1.0) * m));
}

TEST(Decompositions, SingularValuesOfLargeMatricesOfAnyRank) {
  for (const Eigen::Index rank : {Eigen::Index{3}, Eigen::Index{40}}) {
    const MatrixXcd m = MatrixXcd::Random(40, rank) * MatrixXcd::Random(rank, 60);
    const auto parts = svd(m, Eigen::ComputeThinU | Eigen::ComputeThinV);
    const MatrixXcd back =
        parts.matrixU() * parts.singularValues().asDiagonal() * parts.matrixV().adjoint();
    EXPECT_TRUE(back.isApprox(m));
    EXPECT_TRUE((parts.matrixU().adjoint() * parts.matrixU()).isIdentity(1e-12));
    const VectorXd squares = hermitian_eigenvalues(m * m.adjoint()).reverse();
    EXPECT_TRUE(parts.singularValues().cwiseAbs2().isApprox(squares, 1e-12));
  }
}

TEST(Decompositions, TheTriangleInPlaceIsTheCholeskyFactorUpToSigns) {
  const MatrixXd m = MatrixXd::Random(7, 3);
  MatrixXd factored = m;
  qr_in_place(factored);
  const MatrixXd R = factored.topRows(3).triangularView<Eigen::Upper>();
  EXPECT_TRUE((R.transpose() * R).isApprox(m.transpose() * m));
}

TEST(Decompositions, LeastSquaresByQr) {
  const MatrixXd m = MatrixXd::Random(9, 3);
  const VectorXd b = VectorXd::Random(9);
  const VectorXd normal = (m.transpose() * m).ldlt().solve(m.transpose() * b);
  EXPECT_TRUE(least_squares(qr(m), b).isApprox(normal, 1e-10));
  EXPECT_TRUE(least_squares(pivoted_qr(m), b).isApprox(normal, 1e-10));
  EXPECT_TRUE(shortest_least_squares(m, b).isApprox(normal, 1e-10));
  EXPECT_TRUE((pseudo_inverse(m) * b).isApprox(normal, 1e-10));
  for (const MatrixXd& Q : {leading_columns(qr(m), 3), leading_columns(pivoted_qr(m), 3)}) {
    EXPECT_TRUE((Q.transpose() * Q).isIdentity(1e-13));
    EXPECT_TRUE((Q * (Q.transpose() * m)).isApprox(m));
  }
}

TEST(Decompositions, ShortestOfTheLeastSquares) {
  const MatrixXd m = MatrixXd::Ones(2, 2);  // x + y = 2
  EXPECT_TRUE(shortest_least_squares(m, VectorXd::Constant(2, 2.0)).isOnes(1e-14));
}

TEST(Decompositions, InverseAndSolutionOfComplexEquations) {
  const MatrixXcd m = MatrixXcd::Random(4, 4);
  const MatrixXcd b = MatrixXcd::Random(4, 2);
  EXPECT_TRUE((m * inverse(m)).isIdentity(1e-12));
  EXPECT_TRUE((m * solve(m, b)).isApprox(b));
}

}  // namespace
}  // namespace stageid::decompositions_test
