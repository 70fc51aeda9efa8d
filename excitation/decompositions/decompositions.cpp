#include "excitation/decompositions/decompositions.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <limits>

namespace stageid {
namespace {

template <typename Solver, typename Matrix>
Eigen::VectorXcd converged_eigenvalues(const Matrix& m) {
  const Solver solver(m, false);
  if (solver.info() == Eigen::Success) return solver.eigenvalues();
  return Eigen::VectorXcd::Constant(m.rows(), std::numeric_limits<double>::quiet_NaN());
}

template <typename Decomposition>
Eigen::MatrixXd leading(const Decomposition& qr, Eigen::Index columns) {
  return qr.householderQ() * Eigen::MatrixXd::Identity(qr.rows(), columns);
}

void balance(Eigen::MatrixXd& a) {
  for (bool changed = true; changed;) {
    changed = false;
    for (Eigen::Index i = 0; i < a.rows(); ++i) {
      const double diagonal = std::abs(a(i, i));
      const double column = a.col(i).lpNorm<1>() - diagonal;
      const double row = a.row(i).lpNorm<1>() - diagonal;
      if (!(column > 0.0) || !(row > 0.0)) continue;
      const double factor = std::exp2(std::round(0.5 * std::log2(row / column)));
      if (!(column * factor + row / factor < 0.95 * (column + row))) continue;
      a.col(i) *= factor;
      a.row(i) /= factor;
      changed = true;
    }
  }
}

}  // namespace

Eigen::VectorXcd balanced_eigenvalues(Eigen::MatrixXd m) {
  balance(m);
  return eigenvalues(m);
}

Eigen::VectorXcd eigenvalues(const Eigen::MatrixXd& m) {
  return converged_eigenvalues<Eigen::EigenSolver<Eigen::MatrixXd>>(m);
}

Eigen::VectorXcd eigenvalues(const Eigen::MatrixXcd& m) {
  return converged_eigenvalues<Eigen::ComplexEigenSolver<Eigen::MatrixXcd>>(m);
}

Eigen::EigenSolver<Eigen::MatrixXd> general_eigen(const Eigen::MatrixXd& m) {
  return Eigen::EigenSolver<Eigen::MatrixXd>(m);
}

Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> symmetric_eigen(const Eigen::MatrixXd& m) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(m);
}

Eigen::VectorXd hermitian_eigenvalues(const Eigen::MatrixXcd& m) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXcd>(m, Eigen::EigenvaluesOnly).eigenvalues();
}

Eigen::BDCSVD<Eigen::MatrixXd> svd(const Eigen::MatrixXd& m, unsigned vectors) {
  return Eigen::BDCSVD<Eigen::MatrixXd>(m, vectors);
}

Eigen::BDCSVD<Eigen::MatrixXcd> svd(const Eigen::MatrixXcd& m, unsigned vectors) {
  return Eigen::BDCSVD<Eigen::MatrixXcd>(m, vectors);
}

void qr_in_place(Eigen::MatrixXd& m) { Eigen::HouseholderQR<Eigen::Ref<Eigen::MatrixXd>> qr(m); }

Eigen::HouseholderQR<Eigen::MatrixXd> qr(const Eigen::MatrixXd& m) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(m);
}

Eigen::VectorXd least_squares(const Eigen::HouseholderQR<Eigen::MatrixXd>& qr,
                              const Eigen::VectorXd& b) {
  return qr.solve(b);
}

Eigen::ColPivHouseholderQR<Eigen::MatrixXd> pivoted_qr(const Eigen::MatrixXd& m) {
  return Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(m);
}

Eigen::VectorXd least_squares(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& qr,
                              const Eigen::VectorXd& b) {
  return qr.solve(b);
}

Eigen::MatrixXd leading_columns(const Eigen::HouseholderQR<Eigen::MatrixXd>& qr,
                                Eigen::Index columns) {
  return leading(qr, columns);
}

Eigen::MatrixXd leading_columns(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& qr,
                                Eigen::Index columns) {
  return leading(qr, columns);
}

Eigen::VectorXd shortest_least_squares(const Eigen::MatrixXd& m, const Eigen::VectorXd& b) {
  return m.completeOrthogonalDecomposition().solve(b);
}

Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& m) {
  return m.completeOrthogonalDecomposition().pseudoInverse();
}

Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& m, const Eigen::MatrixXd& b) {
  return m.ldlt().solve(b);
}

Eigen::MatrixXcd inverse_cholesky(const Eigen::MatrixXcd& m) {
  const Eigen::LLT<Eigen::MatrixXcd> factors(m);
  if (factors.info() != Eigen::Success)
    return Eigen::MatrixXcd::Constant(m.rows(), m.cols(), std::numeric_limits<double>::quiet_NaN());
  return factors.matrixL().solve(Eigen::MatrixXcd::Identity(m.rows(), m.cols()));
}

Eigen::MatrixXcd inverse(const Eigen::MatrixXcd& m) { return m.partialPivLu().inverse(); }

Eigen::MatrixXcd solve(const Eigen::MatrixXcd& m, const Eigen::MatrixXcd& b) {
  return m.partialPivLu().solve(b);
}

}  // namespace stageid
