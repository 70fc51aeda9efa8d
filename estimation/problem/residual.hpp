#pragma once

#include "estimation/problem/fit_problem.hpp"
#include "frf/response/responding_channels.hpp"

namespace stageid {

/// E = G - P of all channels, n_c x N; without groups, the data.
SplitMatrix residual(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                     const Eigen::MatrixXd& B);

/// 1/(2N) sum vec(E)^H W vec(E), tile by tile: no residual is stored.
double residual_cost(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                     const Eigen::MatrixXd& B);

/// Size of the residual of a model.
struct ResidualSize {
  /// Over the lines with nonzero G of the flagged channels; NaN if there are none.
  double relative_rms = 0.0;
  bool finite = true;  ///< whether every residual is finite
};
ResidualSize residual_size(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                           const Eigen::MatrixXd& B, const ChannelFlags& responding);

}  // namespace stageid
