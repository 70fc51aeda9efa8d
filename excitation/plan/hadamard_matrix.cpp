#include "excitation/plan/hadamard_matrix.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "excitation/words/require.hpp"

namespace stageid {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

bool is_prime(int number) {
  if (number < 2) return false;
  for (int divisor = 2; divisor <= number / divisor; ++divisor) {
    if (number % divisor == 0) return false;
  }
  return true;
}

bool has_paley_one(int size) { return size % 4 == 0 && is_prime(size - 1); }

bool has_paley_two(int size) {
  return size % 4 == 0 && (size / 2 - 1) % 4 == 1 && is_prime(size / 2 - 1);
}

/// Jacobsthal matrix Q_ij = chi(i - j), chi the quadratic character modulo the prime q.
MatrixXd jacobsthal(int q) {
  VectorXd character = VectorXd::Constant(q, -1.0);
  character[0] = 0.0;
  for (long long i = 1; i < q; ++i) character[i * i % q] = 1.0;
  MatrixXd Q(q, q);
  for (int i = 0; i < q; ++i) {
    for (int j = 0; j < q; ++j) Q(i, j) = character[(i - j + q) % q];
  }
  return Q;
}

/// H = I + S with S skew, from q = size - 1 = 3 modulo 4.
MatrixXd paley_one(int size) {
  MatrixXd H(size, size);
  H(0, 0) = 1.0;
  H.row(0).tail(size - 1).setOnes();
  H.col(0).tail(size - 1).setConstant(-1.0);
  H.bottomRightCorner(size - 1, size - 1) =
      jacobsthal(size - 1) + MatrixXd::Identity(size - 1, size - 1);
  return H;
}

/// From the symmetric conference matrix C of order size / 2 = q + 1, q = 1 modulo 4:
///   H = [ C + I, C - I; C - I, -C - I ].
MatrixXd paley_two(int size) {
  const int half = size / 2;
  MatrixXd C(half, half);
  C(0, 0) = 0.0;
  C.row(0).tail(half - 1).setOnes();
  C.col(0).tail(half - 1).setOnes();
  C.bottomRightCorner(half - 1, half - 1) = jacobsthal(half - 1);
  const MatrixXd I = MatrixXd::Identity(half, half);
  MatrixXd H(size, size);
  H << C + I, C - I, C - I, -C - I;
  return H;
}

MatrixXd construct(int size) {
  if (size == 1) return MatrixXd::Ones(1, 1);
  if (size == 2 || (size % 4 == 0 && has_hadamard_matrix(size / 2))) {
    const MatrixXd half = construct(size / 2);
    MatrixXd H(size, size);
    H << half, half, half, -half;
    return H;
  }
  return has_paley_one(size) ? paley_one(size) : paley_two(size);
}

int nearest(int size, int step) {
  int candidate = size;
  while (!has_hadamard_matrix(candidate)) candidate += step;
  return candidate;
}

}  // namespace

bool has_hadamard_matrix(int size) {
  if (size == 1 || size == 2) return true;
  return size >= 4 && size % 4 == 0 &&
         (has_hadamard_matrix(size / 2) || has_paley_one(size) || has_paley_two(size));
}

MatrixXd hadamard_matrix(int size) {
  require(size >= 1, "Hadamard matrix: size must be positive; got {}", size);
  if (!has_hadamard_matrix(size))
    throw std::invalid_argument(fmt::format(
        "Hadamard matrix: unsupported size {}; the nearest supported sizes are {} and {}", size,
        nearest(size, -1), nearest(size, +1)));
  MatrixXd H = construct(size);
  // Negating rows and columns keeps H H^T = size I.
  for (Eigen::Index i = 0; i < size; ++i) H.row(i) *= H(i, 0);
  for (Eigen::Index j = 0; j < size; ++j) H.col(j) *= H(0, j);
  return H;
}

}  // namespace stageid
