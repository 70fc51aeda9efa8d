#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/products/weighted_products.hpp"

namespace stageid {

/// A contiguous range of lines.
struct LineRange {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};

/// Columns d vec(P)_c / d globals for one channel, lines x globals each.
void global_columns(const FitProblem& problem, const FitParameters& beta, const BasisGroup& group,
                    Eigen::Index c, const std::vector<DerivativeColumn>& columns, LineRange lines,
                    Eigen::MatrixXd& re, Eigen::MatrixXd& im);

/// The part of one channel in M d_beta = e (arrow_system.hpp), order (functions, globals).
struct ChannelEquations {
  Eigen::MatrixXd M;
  Eigen::VectorXd e;
};

/// The equations of channel c from its own columns, as one matrix product. For groups of few channels, for which the
/// products shared between channels by line_sums() cost more than they save.
/// @param Y from equation_error_columns(); empty for gn
ChannelEquations channel_equations(const FitProblem& problem, const FitParameters& beta,
                                   const BasisGroup& group, Eigen::Index c,
                                   const std::vector<DerivativeColumn>& columns,
                                   const ComplexColumns* Y, FitMethod method);

}  // namespace stageid
