#pragma once

#include <Eigen/Core>
#include <vector>

#include "excitation/multisine/bounded_signal.hpp"
#include "excitation/multisine/signal_peaks.hpp"
#include "excitation/plan/experiment_plan.hpp"

namespace stageid {

/// Arguments of design_within_limits(), which checks them.
struct LimitedDesignSpec {
  ExperimentSpec
      experiment;        ///< levels and shapes are replaced by the design; crest_iterations >= 1
  Eigen::MatrixXd cost;  ///< c, axes x lines: minimized is sum c / A^2 over the lines of each axis
  std::vector<BoundedSignal> signals;  ///< signals with limits
  double safety = 0.9;                 ///< largest predicted use of any limit
};

struct LimitedDesign {
  ExperimentPlan plan;
  std::vector<SignalPeak> peaks;  ///< of every signal, largest over all runs
  double cost = 0.0;              ///< sum c / A^2 of the result
};

/// The largest multisines within the limits, distributed over lines and axes to minimize
/// sum c_p(l) / A_p(l)^2.
///
/// Axes that are excited together share the bounds. The mean square of signal s,
/// sum_pl |H_sp(l)|^2 A_p(l)^2 / 2, is bounded by its rms limit and by (peak limit - reserve) over its crest
/// factor. Amplitudes (least_variance_power()), phases (reduce_joint_crest()) and crest factors are computed
/// in turn. Then all realizations get their phases and all runs are predicted (SignalPredictor). Axes that
/// are excited together are finally scaled so that no rms and no peak plus reserve uses more than `safety` of
/// its limit.
/// Takes minutes for 13 axes, 4000 lines and 10 realizations; runs on all cores.
/// @throws std::invalid_argument naming the invalid argument: sizes, signs, a reserve as large as its limit,
///         an axis without limits.
LimitedDesign design_within_limits(const FrequencyGrid& grid, const LimitedDesignSpec& spec);

/// Largest use of a signal's limits: (peak + reserve) / peak limit or rms / rms limit.
double limit_use(const BoundedSignal& signal, const SignalPeak& peak);

}  // namespace stageid
