#pragma once

#include <optional>
#include <string>
#include <vector>

#include "acquisition/prediction/plant_prior.hpp"
#include "excitation/plan/limited_design.hpp"
#include "hal/simulator/simulated_stage.hpp"

namespace stageid {

/// The closed loop as far as a prior knows it, and what its signals may do.
struct BoundedLoop {
  std::vector<BoundedSignal> signals;  ///< u: peak and thermal rms, slew; y: window, velocity
  std::vector<std::string> units;      ///< one a signal
  std::vector<std::string> unknown;    ///< sensors with a window that the prior does not show
  /// c, axes x lines: sum_p c_p(l) / A_p(l)^2 is n P M / 4 times the relative variance on line l (n: 1
  /// for single_axis, else the number of axes),
  ///   mean over outputs i of sum_j var G_ij / sum_j |G_ij|^2.
  /// Of no absolute meaning where the prior does not know the noise.
  Eigen::MatrixXd cost;
  bool noise_known = false;
  double extrapolated_below_hz = 0.0;  ///< of the prior
  double extrapolation_misfit = 0.0;   ///< of the prior
};

/// Builds it from the prior and the controller:
///   u = S r, S = (I - K G)^-1 on the excited actuators, y = G u;
///   Var(G_ij) = C_ii sum_p |(S^-1)_jp|^2 4 / (n P M A_p^2),
/// and of the noise v in y: (I - G K)^-1 v and K (I - G K)^-1 v, six standard deviations of which are the
/// signals' reserve, above the band with the highest line's density. The peak from rest gets a margin of 2 %,
/// and of what the prior's extrapolation below its lines leaves of them.
/// @param outputs   sensors of the response that is wanted; empty: all that the prior knows
/// @param velocity_m_s  limit of every sensor's velocity; empty: none
/// @throws std::invalid_argument naming an axis that the stage or the prior lacks, or an unknown output.
BoundedLoop bounded_loop(const FrequencyGrid& grid, const ExperimentSpec& experiment,
                         const WaferStageSpec& stage, const PlantPrior& prior,
                         const std::vector<std::string>& outputs,
                         const Eigen::VectorXd& velocity_m_s);

/// Mean over the lines of the relative variance (see BoundedLoop::cost) that one realization of one
/// period would leave: of a plan, over realizations times periods.
double relative_variance(const ExperimentPlan& plan, const Eigen::MatrixXd& cost);

}  // namespace stageid
