#pragma once

#include <string>
#include <vector>

#include "acquisition/prediction/plant_prior.hpp"
#include "excitation/plan/limited_design.hpp"
#include "hal/stage/stage_spec.hpp"

namespace stageid {

/// The closed loop according to a prior, and the limits of its signals.
struct BoundedLoop {
  std::vector<BoundedSignal> signals;  ///< u: peak and thermal rms, slew; y: window, velocity
  std::vector<std::string> units;      ///< one per signal
  std::vector<std::string> unknown;    ///< sensors with a window that are not in the prior
  /// c, axes x lines: sum_p c_p(l) / A_p(l)^2 is n P M / 4 times the relative variance on line l (n: 1
  /// for single_axis, else the number of axes),
  ///   mean over outputs i of sum_j var G_ij / sum_j |G_ij|^2.
  /// Only its shape is meaningful if the prior has no noise estimate.
  Eigen::MatrixXd cost;
  bool noise_known = false;
  double extrapolated_below_hz = 0.0;  ///< of the prior
  double extrapolation_misfit = 0.0;   ///< of the prior
};

/// Computes it from the prior and the controller:
///   u = S r, S = (I - K G)^-1 on the excited actuators, y = G u;
///   Var(G_ij) = C_ii sum_p |(S^-1)_jp|^2 4 / (n P M A_p^2).
/// Six standard deviations of noise are reserved in each signal: (I - G K)^-1 v and K (I - G K)^-1 v for the noise v
/// in y, above the band with the density of the highest line. The peak from rest gets a margin of 2 %, plus the misfit
/// of the extrapolation of the prior below its lines.
/// @param outputs   sensors of the desired response; empty: all in the prior
/// @param velocity_m_s  limit of the velocity of every sensor; empty: none
/// @throws std::invalid_argument naming an axis that the stage or the prior lacks, or an unknown output.
BoundedLoop bounded_loop(const FrequencyGrid& grid, const ExperimentSpec& experiment,
                         const StageSpec& stage, const PlantPrior& prior,
                         const std::vector<std::string>& outputs,
                         const Eigen::VectorXd& velocity_m_s);

/// Mean over the lines of the relative variance (see BoundedLoop::cost) after one realization of one period. Divide by
/// realizations times periods for that of the plan.
double relative_variance(const ExperimentPlan& plan, const Eigen::MatrixXd& cost);

}  // namespace stageid
