#pragma once

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

/// Eigen's decompositions of dense matrices. Each takes about ten seconds to compile, so only one source does
/// (docs/decisions/build-time.md).
namespace stageid {

/// Eigenvalues of a square matrix, unordered; NaN if the iteration does not converge.
Eigen::VectorXcd eigenvalues(const Eigen::MatrixXd& m);
Eigen::VectorXcd eigenvalues(const Eigen::MatrixXcd& m);

/// The same of a system, whose states may have different units: with metres and newtons, eigenvalues() would lose half
/// their digits. States are scaled by powers of two until rows and columns have similar norms.
/// Source: B. N. Parlett and C. Reinsch, Numer. Math. 13 (1969) 293.
Eigen::VectorXcd balanced_eigenvalues(Eigen::MatrixXd m);
/// Far above their rounding errors for some hundred rows.
inline constexpr double kEigenvalueRounding = 1e-8;

/// Eigenvalues and eigenvectors of a square matrix, unordered.
Eigen::EigenSolver<Eigen::MatrixXd> general_eigen(const Eigen::MatrixXd& m);

/// Eigenvalues of a symmetric matrix in increasing order, and its eigenvectors.
Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> symmetric_eigen(const Eigen::MatrixXd& m);

/// Eigenvalues of a Hermitian matrix in increasing order.
Eigen::VectorXd hermitian_eigenvalues(const Eigen::MatrixXcd& m);

/// Singular values, largest first, and the requested vectors: Eigen::ComputeThinU, Eigen::ComputeFullV, ... or 0.
Eigen::BDCSVD<Eigen::MatrixXd> svd(const Eigen::MatrixXd& m, unsigned vectors);
Eigen::BDCSVD<Eigen::MatrixXcd> svd(const Eigen::MatrixXcd& m, unsigned vectors);

/// Leaves R of m = Q R in the upper triangle, Householder vectors below.
void qr_in_place(Eigen::MatrixXd& m);

/// m = Q R for least squares; rows >= columns.
Eigen::HouseholderQR<Eigen::MatrixXd> qr(const Eigen::MatrixXd& m);
Eigen::VectorXd least_squares(const Eigen::HouseholderQR<Eigen::MatrixXd>& qr,
                              const Eigen::VectorXd& b);

/// m P = Q R with the largest remaining column first.
Eigen::ColPivHouseholderQR<Eigen::MatrixXd> pivoted_qr(const Eigen::MatrixXd& m);
Eigen::VectorXd least_squares(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& qr,
                              const Eigen::VectorXd& b);

/// The first columns of Q.
Eigen::MatrixXd leading_columns(const Eigen::HouseholderQR<Eigen::MatrixXd>& qr,
                                Eigen::Index columns);
Eigen::MatrixXd leading_columns(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& qr,
                                Eigen::Index columns);

/// The shortest x that minimizes |m x - b|, and the matrix that gives it.
Eigen::VectorXd shortest_least_squares(const Eigen::MatrixXd& m, const Eigen::VectorXd& b);
Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& m);

/// x of m x = b for a symmetric m, by LDL^T.
Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& m, const Eigen::MatrixXd& b);

/// L^-1 of a Hermitian m = L L^H; NaN if m is not positive definite.
Eigen::MatrixXcd inverse_cholesky(const Eigen::MatrixXcd& m);

/// By LU decomposition with row pivoting.
Eigen::MatrixXcd inverse(const Eigen::MatrixXcd& m);
Eigen::MatrixXcd solve(const Eigen::MatrixXcd& m, const Eigen::MatrixXcd& b);

}  // namespace stageid
