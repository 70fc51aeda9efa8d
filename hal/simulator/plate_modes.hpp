#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// Thin rectangular plate, all edges free, centred at the origin.
struct FreePlate {
  double length_x_m = 1.0;
  double length_y_m = 1.0;
  double poisson_ratio = 0.3;
};

/// Flexible modes of a free plate by the Rayleigh-Ritz method with products of Legendre
/// polynomials, w = sum_pq c_pq P_p(2x/a) P_q(2y/b).
///
/// Free edges have natural boundary conditions only, which the polynomials need not satisfy. The first two
/// polynomials are exactly the rigid motions. The four symmetry classes (even or odd in x, in y) are solved
/// separately, so that near-repeated modes of different classes do not mix.
/// Energy and notation: A. W. Leissa, Vibration of Plates, NASA SP-160 (1969).
class PlateModes {
 public:
  /// @param count number of flexible modes, lowest first.
  /// @throws std::invalid_argument if a length is not positive, the Poisson ratio is not in
  ///         [0, 0.5), or `count` is negative or above max_count().
  PlateModes(const FreePlate& plate, int count);

  /// Largest number of modes that the polynomials represent accurately.
  static int max_count() noexcept;

  int count() const noexcept { return static_cast<int>(modes_.size()); }

  /// omega sqrt(rho h / D) in rad/m^2, of mode `mode` (0-based, ascending).
  double wave_parameter(int mode) const { return modes_[mode].parameter; }

  /// Displacement of a mode at (x, y) in m; its mean square over the plate is 1, and it is positive
  /// at the corner (a/2, b/2).
  double shape(int mode, double x_m, double y_m) const;

 private:
  struct Mode {
    double parameter = 0.0;
    int parity_x = 0;  // 0 even, 1 odd
    int parity_y = 0;
    Eigen::MatrixXd coefficients;  // rows: degree in x, columns: in y, of that parity only
  };
  void append_class(int parity_x, int parity_y);

  FreePlate plate_;
  std::vector<Mode> modes_;
};

}  // namespace stageid
