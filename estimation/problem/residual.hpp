#pragma once

#include "estimation/problem/fit_problem.hpp"
#include "frf/response/responding_channels.hpp"

namespace stageid {

/// E = G - P of all channels, and what follows from it.
struct Residual {
  Eigen::MatrixXd re;  ///< n_c x N
  Eigen::MatrixXd im;
  double cost = 0.0;  ///< 1/(2N) sum vec(E)^H W vec(E)
};

/// The data themselves without groups.
Residual residual(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                  const Eigen::MatrixXd& B);

/// The cost alone, tile by tile: no residual is stored.
double residual_cost(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                     const Eigen::MatrixXd& B);

/// What a model leaves of the data.
struct ResidualSize {
  /// Over lines and channels that are flagged, where G is not 0; NaN if that is nowhere.
  double relative_rms = 0.0;
  bool finite = true;  ///< every residual is
};
ResidualSize residual_size(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                           const Eigen::MatrixXd& B, const ChannelFlags& responding);

/// sum W |P|^2 of the groups' model, and sum W |G|^2.
struct WeightedPower {
  double model = 0.0;
  double data = 0.0;
};
WeightedPower weighted_power(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                             const Eigen::MatrixXd& B);

}  // namespace stageid
