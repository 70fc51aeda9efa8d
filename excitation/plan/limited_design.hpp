#pragma once

#include <Eigen/Core>
#include <vector>

#include "excitation/multisine/bounded_signal.hpp"
#include "excitation/multisine/signal_peaks.hpp"
#include "excitation/plan/experiment_plan.hpp"

namespace stageid {

/// What to design. Any values may stand here; they are checked by design_within_limits().
struct LimitedDesignSpec {
  ExperimentSpec experiment;  ///< levels and shapes are designed; crest_iterations >= 1
  Eigen::MatrixXd cost;       ///< c, axes x lines: variance wanted small is sum c / A^2 over the
                              ///< lines that each axis has
  std::vector<BoundedSignal> signals;  ///< what must stay inside
  double safety = 0.9;                 ///< largest predicted use of any limit
};

struct LimitedDesign {
  ExperimentPlan plan;
  std::vector<SignalPeak> peaks;  ///< of every signal, largest over all runs
  double cost = 0.0;              ///< sum c / A^2, what was reached
};

/// The largest multisines that stay inside the limits, spread over lines and axes for the least
/// sum c_p(l) / A_p(l)^2.
///
/// Axes that are excited together share the bounds: the mean square of signal s,
/// sum_pl |H_sp(l)|^2 A_p(l)^2 / 2, is bounded by its rms limit and by (peak limit - reserve) over its
/// crest factor. The amplitudes come from least_variance_power(), the phases from
/// reduce_joint_crest(), the crest factors from the phases, in turn; then all realizations get their
/// phases, all runs are predicted (SignalPredictor), and the axes that are excited together are
/// scaled so that no peak plus reserve, and no rms, uses more than `safety` of its limit.
/// Takes minutes for 13 axes, 4000 lines and 10 realizations; runs on all cores.
/// @throws std::invalid_argument naming what does not fit: sizes, signs, a reserve that leaves nothing
///         of a limit, an axis that no limit bounds.
LimitedDesign design_within_limits(const FrequencyGrid& grid, const LimitedDesignSpec& spec);

/// Largest use of a limit by a signal: (peak + reserve) / peak limit or rms / rms limit.
double limit_use(const BoundedSignal& signal, const SignalPeak& peak);

}  // namespace stageid
