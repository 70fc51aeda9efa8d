#include "estimation/search/trial_options.hpp"

#include <algorithm>

#include "estimation/problem/fit_problem.hpp"
#include "estimation/search/search_constants.hpp"

namespace stageid {

FitOptions trial_options(const FrfEstimate& frf, const FitOptions& options) {
  FitOptions trial = options;
  trial.user_weights = make_weights(frf, options);
  trial.weighting = Weighting::user;
  trial.user_weight_matrices.resize(0, 0);
  trial.method = FitMethod::gn;
  trial.residue_rank = trial.rigid_body_rank = 0;
  trial.mode_ranks.clear();
  trial.uncertainty = trial.covariance = trial.judge_modes = trial.shrink_hidden = false;
  trial.max_iterations = std::min(kGrowthIterations, options.max_iterations);
  trial.gradient_tolerance = 1e-5;
  trial.step_tolerance = 1e-7;
  return trial;
}

}  // namespace stageid
