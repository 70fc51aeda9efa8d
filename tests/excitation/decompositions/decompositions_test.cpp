#include "excitation/decompositions/decompositions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/support/process/random_numbers.hpp"

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
  MatrixXd m = companion();
  for (Eigen::Index i = 0; i < 4; ++i)
    for (Eigen::Index j = 0; j < 4; ++j) m(i, j) *= units[i] / units[j];
  expect_roots(balanced_eigenvalues(m));
}

TEST(Decompositions, EigenvaluesThatDoNotConvergeAreNaN) {
  MatrixXd m = companion();
  m(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(eigenvalues(m).array().isNaN().all());
  EXPECT_TRUE(balanced_eigenvalues(m).array().isNaN().all());
}

TEST(Decompositions, EigenvectorsBelongToTheirEigenvalues) {
  const auto eigen = general_eigen(companion());
  const MatrixXcd m = companion().cast<Complex>();
  const MatrixXcd V = eigen.eigenvectors();
  const MatrixXcd lambda = eigen.eigenvalues().asDiagonal().toDenseMatrix();
  EXPECT_TRUE(MatrixXcd(m * V).isApprox(MatrixXcd(V * lambda), 1e-12));
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

MatrixXcd product_of(const Eigen::BDCSVD<MatrixXcd>& parts) {
  const MatrixXcd S = parts.singularValues().cast<Complex>().asDiagonal().toDenseMatrix();
  const MatrixXcd US = parts.matrixU() * S;
  const MatrixXcd V = parts.matrixV().adjoint();
  return US * V;
}

TEST(Decompositions, SingularVectorsOfTheRequestedKind) {
  MatrixXd m(3, 2);
  m << 3.0, 0.0, 0.0, 4.0, 0.0, 0.0;
  EXPECT_TRUE(svd(m, 0).singularValues().isApprox(Eigen::Vector2d(4.0, 3.0)));
  const MatrixXcd turned = Complex(0.0, 1.0) * m;
  EXPECT_TRUE(product_of(svd(turned, Eigen::ComputeThinU | Eigen::ComputeFullV)).isApprox(turned));
}

TEST(Decompositions, SingularValuesOfLargeMatricesOfAnyRank) {
  for (const Eigen::Index rank : {Eigen::Index{3}, Eigen::Index{40}}) {
    test::RandomNumbers random(1);
    const MatrixXcd tall = circular_matrix(random, 40, rank);
    const MatrixXcd wide = circular_matrix(random, rank, 60);
    const MatrixXcd m = tall * wide;
    const auto parts = svd(m, Eigen::ComputeThinU | Eigen::ComputeThinV);
    EXPECT_TRUE(product_of(parts).isApprox(m));
    const MatrixXcd adjoint = parts.matrixU().adjoint();
    EXPECT_TRUE(MatrixXcd(adjoint * parts.matrixU()).isIdentity(1e-12));
    const MatrixXcd m_adjoint = m.adjoint();
    const VectorXd squares = hermitian_eigenvalues(m * m_adjoint).reverse();
    EXPECT_TRUE(parts.singularValues().cwiseAbs2().isApprox(squares, 1e-12));
  }
}

TEST(Decompositions, TheTriangleInPlaceIsTheCholeskyFactorUpToSigns) {
  test::RandomNumbers random(1);
  const MatrixXd m = random_matrix(random, 7, 3);
  MatrixXd factored = m;
  qr_in_place(factored);
  const MatrixXd R = factored.topRows(3).triangularView<Eigen::Upper>();
  const MatrixXd gram = R.transpose() * R;
  EXPECT_TRUE(gram.isApprox(m.transpose() * m));
}

// What is left is orthogonal to every column.
TEST(Decompositions, LeastSquaresByQr) {
  test::RandomNumbers random(1);
  const MatrixXd m = random_matrix(random, 9, 3);
  const MatrixXd adjoint = m.transpose();
  const VectorXd b = random_vector(random, 9);
  for (const VectorXd& x : {least_squares(qr(m), b), least_squares(pivoted_qr(m), b),
                            shortest_least_squares(m, b), VectorXd(pseudo_inverse(m) * b)}) {
    const VectorXd left = b - m * x;
    EXPECT_LT((adjoint * left).norm(), 1e-10 * b.norm());
  }
  for (const MatrixXd& Q : {leading_columns(qr(m), 3), leading_columns(pivoted_qr(m), 3)}) {
    const MatrixXd transposed = Q.transpose();
    EXPECT_TRUE(MatrixXd(transposed * Q).isIdentity(1e-13));
    const MatrixXd coordinates = transposed * m;
    EXPECT_TRUE(MatrixXd(Q * coordinates).isApprox(m));
  }
}

TEST(Decompositions, ShortestOfTheLeastSquares) {
  const MatrixXd m = MatrixXd::Ones(2, 2);  // x + y = 2
  EXPECT_TRUE(shortest_least_squares(m, VectorXd::Constant(2, 2.0)).isOnes(1e-14));
}

TEST(Decompositions, InverseAndSolutionOfComplexEquations) {
  test::RandomNumbers random(1);
  const MatrixXcd m = circular_matrix(random, 4, 4);
  const MatrixXcd b = circular_matrix(random, 4, 2);
  EXPECT_TRUE((m * inverse(m)).isIdentity(1e-12));
  EXPECT_TRUE((m * solve(m, b)).isApprox(b));
}

TEST(Decompositions, SolutionOfSymmetricEquationsThatAreNotDefinite) {
  MatrixXd m(2, 2);
  m << 2.0, 1.0, 1.0, -3.0;
  const MatrixXd b = MatrixXd::Identity(2, 2);
  EXPECT_TRUE(MatrixXd(m * solve_symmetric(m, b)).isApprox(b));
}

TEST(Decompositions, InverseCholeskyFactorWhitens) {
  test::RandomNumbers random(1);
  const MatrixXcd root = circular_matrix(random, 4, 6);
  const MatrixXcd root_adjoint = root.adjoint();
  const MatrixXcd C = root * root_adjoint;
  const MatrixXcd W = inverse_cholesky(C);
  const MatrixXcd W_adjoint = W.adjoint();
  const MatrixXcd WC = W * C;
  EXPECT_TRUE(MatrixXcd(WC * W_adjoint).isIdentity(1e-11));
  EXPECT_EQ(W(0, 3), 0.0);
  EXPECT_TRUE(inverse_cholesky(-C).array().isNaN().all());
}

}  // namespace
}  // namespace stageid::decompositions_test
