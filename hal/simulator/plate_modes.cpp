#include "hal/simulator/plate_modes.hpp"

#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/KroneckerProduct>

#include "excitation/decompositions/decompositions.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

// Degrees 0 ... 17 in each direction: nine polynomials of each parity. With these, the frequencies of the first
// 40 modes have converged to better than 1e-3, those of the first 25 to 1e-6.
constexpr int kDegrees = 18;
constexpr int kHalf = kDegrees / 2;
constexpr int kMaxCount = 40;

// phi_n = sqrt(2n + 1) P_n has mean square 1 on [-1, 1], and phi_n' = sum_k D(k, n) phi_k with
// D(k, n) = sqrt((2n + 1)(2k + 1)) for k = n-1, n-3, ...
Eigen::MatrixXd derivative_matrix() {
  Eigen::MatrixXd d = Eigen::MatrixXd::Zero(kDegrees, kDegrees);
  for (int n = 0; n < kDegrees; ++n)
    for (int k = n - 1; k >= 0; k -= 2) d(k, n) = std::sqrt((2.0 * n + 1.0) * (2.0 * k + 1.0));
  return d;
}

// Every second row and column: inner products between polynomials of one parity.
Eigen::MatrixXd of_parity(const Eigen::MatrixXd& full, int parity) {
  Eigen::MatrixXd half(kHalf, kHalf);
  for (int i = 0; i < kHalf; ++i)
    for (int j = 0; j < kHalf; ++j) half(i, j) = full(2 * i + parity, 2 * j + parity);
  return half;
}

Eigen::MatrixXd kronecker(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return Eigen::kroneckerProduct(a, b);
}

Eigen::VectorXd polynomials(double t, int parity) {
  Eigen::VectorXd legendre(kDegrees);
  legendre[0] = 1.0;
  legendre[1] = t;
  for (int n = 1; n + 1 < kDegrees; ++n)
    legendre[n + 1] = ((2.0 * n + 1.0) * t * legendre[n] - n * legendre[n - 1]) / (n + 1.0);
  Eigen::VectorXd half(kHalf);
  for (int i = 0; i < kHalf; ++i) {
    const int n = 2 * i + parity;
    half[i] = std::sqrt(2.0 * n + 1.0) * legendre[n];
  }
  return half;
}

void check(const FreePlate& plate, int count) {
  require(plate.length_x_m > 0.0 && plate.length_y_m > 0.0 && std::isfinite(plate.length_x_m) &&
              std::isfinite(plate.length_y_m),
          "plate: lengths must be positive; got {} x {} m", plate.length_x_m, plate.length_y_m);
  require(plate.poisson_ratio >= 0.0 && plate.poisson_ratio < 0.5,
          "plate: poisson_ratio must be in [0, 0.5); got {}", plate.poisson_ratio);
  require(count >= 0 && count <= kMaxCount, "plate: the number of modes must be 0 to {}; got {}",
          kMaxCount, count);
}

}  // namespace

int PlateModes::max_count() noexcept { return kMaxCount; }

PlateModes::PlateModes(const FreePlate& plate, int count) : plate_(plate) {
  check(plate, count);
  for (int parity_x : {0, 1})
    for (int parity_y : {0, 1}) append_class(parity_x, parity_y);
  std::sort(modes_.begin(), modes_.end(),
            [](const Mode& a, const Mode& b) { return a.parameter < b.parameter; });
  modes_.resize(count);
}

// Strain energy over D/2 and the plate's area:
//   mean of w_xx^2 + w_yy^2 + 2 nu w_xx w_yy + 2 (1 - nu) w_xy^2;
// the mass matrix is the identity because the basis is orthonormal.
void PlateModes::append_class(int parity_x, int parity_y) {
  static const Eigen::MatrixXd d1 = derivative_matrix();
  static const Eigen::MatrixXd d2 = d1 * d1;
  static const Eigen::MatrixXd bending = d2.transpose() * d2;
  static const Eigen::MatrixXd slope = d1.transpose() * d1;

  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(kHalf, kHalf);
  const Eigen::MatrixXd cross_x = of_parity(d2.transpose(), parity_x);
  const Eigen::MatrixXd cross_y = of_parity(d2.transpose(), parity_y);
  const double sx = std::pow(2.0 / plate_.length_x_m, 2);
  const double sy = std::pow(2.0 / plate_.length_y_m, 2);
  const double nu = plate_.poisson_ratio;

  const Eigen::MatrixXd stiffness =
      sx * sx * kronecker(of_parity(bending, parity_x), identity) +
      sy * sy * kronecker(identity, of_parity(bending, parity_y)) +
      nu * sx * sy *
          (kronecker(cross_x, cross_y.transpose()) + kronecker(cross_x.transpose(), cross_y)) +
      2.0 * (1.0 - nu) * sx * sy *
          kronecker(of_parity(slope, parity_x), of_parity(slope, parity_y));

  const auto solver = symmetric_eigen(stiffness);
  // One rigid motion (heave and the two tilts) in every class except the doubly odd one.
  const Eigen::Index rigid = (parity_x == 1 && parity_y == 1) ? 0 : 1;
  for (Eigen::Index i = rigid; i < stiffness.rows(); ++i) {
    // In the Kronecker product the index in x is the slow one: transpose to (degree in x, degree in y).
    const Eigen::MatrixXd yx =
        Eigen::Map<const Eigen::MatrixXd>(solver.eigenvectors().col(i).data(), kHalf, kHalf);
    modes_.push_back({std::sqrt(solver.eigenvalues()[i]), parity_x, parity_y, yx.transpose()});
    const int index = static_cast<int>(modes_.size()) - 1;
    if (shape(index, 0.5 * plate_.length_x_m, 0.5 * plate_.length_y_m) < 0.0)
      modes_.back().coefficients *= -1.0;
  }
}

double PlateModes::shape(int mode, double x_m, double y_m) const {
  const Mode& m = modes_[mode];
  return polynomials(2.0 * x_m / plate_.length_x_m, m.parity_x)
      .dot(m.coefficients * polynomials(2.0 * y_m / plate_.length_y_m, m.parity_y));
}

}  // namespace stageid
