#pragma once

#include <Eigen/Core>
#include <array>
#include <complex>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// The lines of a fit, and the hold and sampling at which the model is evaluated.
struct ModelLines {
  Eigen::VectorXd omega_rad_s;
  double sample_period_s = 0.0;  ///< needed unless hold is none
  HoldModel hold = HoldModel::none;
};

/// Complex columns with real and imaginary parts stored separately, for vectorized arithmetic on whole columns.
struct SplitMatrix {
  Eigen::MatrixXd re;
  Eigen::MatrixXd im;

  void resize(Eigen::Index rows, Eigen::Index cols) {
    re.resize(rows, cols);
    im.resize(rows, cols);
  }
  void set_zero(Eigen::Index rows, Eigen::Index cols) {
    re.setZero(rows, cols);
    im.setZero(rows, cols);
  }
  Eigen::Index cols() const noexcept { return re.cols(); }
  SplitMatrix middle_rows(Eigen::Index first, Eigen::Index count) const {
    return {re.middleRows(first, count), im.middleRows(first, count)};
  }
  std::complex<double> operator()(Eigen::Index row, Eigen::Index col) const {
    return {re(row, col), im(row, col)};
  }
  bool operator==(const SplitMatrix& other) const = default;
};

/// A fraction 1/(s - lambda) and its square on every line, through hold, delay and sampler, with their derivatives to
/// the delay; unrequested ones are empty.
struct Fractions {
  SplitMatrix simple;         ///< N x 1
  SplitMatrix squared;        ///< N x 1
  SplitMatrix simple_delay;   ///< N x 1
  SplitMatrix squared_delay;  ///< N x 1
};

/// Expansion of a Fractions column: first() (c[0] + c[1] q + c[2] q^2), q = 1/(x - x_lambda).
struct FractionExpansion {
  using Coefficients = std::array<std::complex<double>, 3>;
  Coefficients simple = {};
  Coefficients squared = {};
  Coefficients simple_delay = {};
  Coefficients squared_delay = {};
};

/// The hold equivalent of continuous-time functions on given lines: hold, delay and sampler, which all
/// poles share.
///
/// They act on each fraction 1/(s - lambda) and 1/(s - lambda)^2 in closed form (docs/theory.md, section 6).
/// With delay = (d + f) T, E = e^{lambda T}, e_1 = e^{lambda (1-f) T}, phi(t) = (e^{lambda t} - 1)/lambda,
///   H{1/(s - lambda)} = z^-d [ z^-1 phi((1-f) T) + z^-2 phi(T) e_1 / (1 - E z^-1) ],
/// and H{1/(s - lambda)^2} is its derivative to lambda.
class HoldEquivalent {
 public:
  HoldEquivalent(const ModelLines& lines, double delay_s);

  Eigen::Index lines() const noexcept { return first_.re.rows(); }

  struct Wanted {
    bool squares = false;
    bool delay = false;
  };
  void fractions(std::complex<double> lambda, Wanted wanted, Fractions& out) const;
  FractionExpansion expansion(std::complex<double> lambda) const;
  /// The image x_lambda of a pole, e^{lambda T} or lambda, and its derivative to lambda.
  std::complex<double> place(std::complex<double> lambda) const;
  std::complex<double> place_slope(std::complex<double> lambda) const;
  /// q = 1/(x - x_lambda) on every line, N x 1.
  void reciprocal(std::complex<double> lambda, SplitMatrix& q) const;

  /// The variable x in which sampled functions are rational, z or s, on every line, and the additional factor: whole
  /// delays, or delay and hold. N x 1.
  bool exact() const noexcept { return exact_; }
  const SplitMatrix& x() const noexcept { return z_; }
  const SplitMatrix& first() const noexcept { return first_; }

  /// The constant 1 (a held input at the sampling instants) and its derivative to the delay.
  const SplitMatrix& constant() const noexcept { return constant_; }
  const SplitMatrix& constant_delay() const noexcept { return constant_delay_; }

 private:
  bool exact_;
  double period_s_;
  double rest_s_ = 0.0;  // (1 - f) T
  SplitMatrix z_;        // exact: e^{j omega T}; else j omega
  SplitMatrix first_;    // exact: z^-(d+1); else delay and hold
  SplitMatrix constant_;
  SplitMatrix constant_delay_;
};

}  // namespace stageid
