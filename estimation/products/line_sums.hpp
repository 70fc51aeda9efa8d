#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

#include "estimation/products/equation_method.hpp"

namespace stageid {

/// Sums over the lines for the equations of the channels of a group; one column per channel. Symbols as in
/// fit_problem.hpp, with Y the columns of the equation error and T = B dF/d delay.
struct LineSums {
  Eigen::MatrixXd FF;  ///< triangle x members: sum W Re{conj(F_i) F_j}
  Eigen::MatrixXd FD;  ///< (n_f n_d) x members, row j n_d + d: sum W Re{conj(F_j) D_d}
  Eigen::MatrixXd FY;  ///< (n_f n_a) x members: sum Re{conj(F_j) Y_p W E}; empty for gn
  Eigen::MatrixXd FE;  ///< n_f x members: sum Re{conj(F) W E}
  Eigen::MatrixXd DD;  ///< n_d x n_d, lower: sum Re{conj(D_l) D_r} sum_c B(c,f_l) W B(c,f_r)
  Eigen::MatrixXd ZY;  ///< n_a x n_a: sum Re{conj(dP/da_p) Y_q W E}
  Eigen::VectorXd ZE;  ///< n_a: sum Re{conj(dP/da) W E}
  Eigen::MatrixXd YY;  ///< n_a x n_a: sum W |E|^2 Re{conj(Y) Y}; sk only
  Eigen::VectorXd YE;  ///< n_a: sum W |E|^2 Re{Y}; sk only
  Eigen::MatrixXd TF;  ///< n_f x members: sum W Re{conj(T) F}; this and below only for free delays
  Eigen::MatrixXd TD;  ///< n_d x members
  Eigen::MatrixXd TY;  ///< n_a x members
  Eigen::VectorXd TT;  ///< members
  Eigen::VectorXd TE;  ///< members
  Eigen::MatrixXd S;   ///< members x base columns: sum W |first|^2 base; see PairReduction
  Eigen::MatrixXd S_re;  ///< members x simple base columns: sum W E conj(first) base; not for gn
  Eigen::MatrixXd S_im;
  LineSums& operator+=(const LineSums& other);
};

/// The products needed for the sums of the channels of a group, shared by all of its blocks.
struct GroupProducts {
  GroupProducts(const EquationMethod& method, const BasisGroup& group);

  const EquationMethod& method;
  const BasisGroup& group;
  PairReduction FF, FD, FY, DD;  ///< FY: empty for gn
  /// The direct pairs of DD, by the functions whose derivatives they are.
  std::map<std::pair<Eigen::Index, Eigen::Index>, std::vector<ColumnPair>> functions;
};

/// @param block channels of the group
/// @param B their numerators, members x n_f
LineSums line_sums(const GroupProducts& products, const TileRange& block, const Eigen::MatrixXd& B);

}  // namespace stageid
