#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/model/basis.hpp"
#include "estimation/problem/shared_matrix.hpp"

namespace stageid {

/// A function of frequency with one pair of poles: first (constant + c q + d q^2 + c* p + d* p^2)
/// with q = 1/(x - x_lambda), p = 1/(x - x_lambda*); x and first as in HoldEquivalent.
struct FractionColumn {
  Eigen::Index pair = -1;  ///< index of the pair of poles; -1: the function is not of this form
  double constant = 0.0;
  std::complex<double> simple = 0.0;   ///< c
  std::complex<double> squared = 0.0;  ///< d
};

/// The functions of a group of channels as fractions, so that the products of any two of them are also sums of
/// fractions (see PairReduction).
struct FractionColumns {
  bool exact = false;                        ///< x = e^{j omega T}; else j omega
  double highest_rad_s = 0.0;                ///< of the lines
  std::vector<std::complex<double>> lambda;  ///< one per pair, rad/s
  std::vector<std::complex<double>> place;   ///< x_lambda
  SplitMatrix first;                         ///< N x 1
  /// See fraction_base(); the same for every delay.
  SharedMatrix<Eigen::MatrixXd> base;
  std::vector<FractionColumn> F;  ///< as the columns of BasisGroup
  std::vector<FractionColumn> D;  ///< empty without squares
  std::vector<FractionColumn> Y;  ///< of the equation error, see EquationMethod::Y

  Eigen::Index pairs() const noexcept { return std::ssize(lambda); }
  Eigen::Index simple_columns() const noexcept { return 1 + 4 * pairs(); }
};

/// N x (1 + 4 P) or, with squares, N x (1 + 8 P): 1; Re q, Im q, Re p, Im p per pair; then those of the squares.
Eigen::MatrixXd fraction_base(const HoldEquivalent& through,
                              const std::vector<std::complex<double>>& lambda, bool squares);

/// Everything but the base.
/// @param a denominator coefficients, one vector per submodel
/// @param derivatives whether D and Y are computed
/// @param held coefficients without columns of D, counted over all submodels
FractionColumns fraction_columns(const HoldEquivalent& through, double highest_rad_s,
                                 const std::vector<SubmodelShape>& shapes,
                                 const std::vector<Eigen::VectorXd>& a, bool derivatives,
                                 const std::vector<Eigen::Index>& held = {});

/// Coefficient c of the equation-error column s^q / A at a root. It is taken through the image of the pole, so that it
/// is d log(x - x_lambda) / d a_q up to sign, and a fraction in x for the exact hold too.
std::complex<double> equation_error_residue(const HoldEquivalent& through,
                                            const Eigen::Ref<const Eigen::VectorXd>& a,
                                            std::complex<double> lambda, Eigen::Index q);

}  // namespace stageid
