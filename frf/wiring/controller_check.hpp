#pragma once

#include <vector>

#include "frf/runs/health_record.hpp"
#include "frf/wiring/channel_change.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// An actuator that does not do what excitation and controller ask for.
struct ControllerMisfit {
  Eigen::Index actuator = 0;
  double relative =
      0.0;  ///< |u - r + C y| / |C y| over the lines; / |u| if the controller leaves it alone
  bool controlled = true;  ///< C y is not zero
  bool of_all = false;     ///< most actuators are so: it is the controller, not the channel
};

struct ControllerCheck {
  std::vector<ChannelChange>
      changes;  ///< in the order in which they explain the most; undone in the record
  std::vector<ControllerMisfit> misfits;  ///< what no change of one channel explains
};

/// Does u = r - C y hold between the recorded signals, line by line (S + T = I with S = U R^-1 and
/// T = C Y R^-1)? If not, which wrongly recorded channels explain it?
///
/// With E = U - R + C Y, means over the periods, and the weights w = 1 / (s^2 + (epsilon C Y)^2), s^2
/// the variance of E from its scatter over periods, every change of one channel moves E along one
/// direction X: E - d X, d real. Least squares give d, its deviation (2 |X|_w^2)^(-1/2) and how much
/// of |E|_w^2 it explains; the exchange of two channels has no parameter. The change that explains
/// most is undone and the next one looked for.
///
/// A change counts if d is 6 deviations off zero (false alarm: 2e-9 a candidate, 6e-7 for the 300
/// candidates of a wafer stage; s^2 is too large rather than too small, since what noise leaves in E is the
/// difference of two ends of a period and cancels in the mean), if it explains 30 % of the misfit it is
/// held against, and if it is large enough to matter: a gain 2 % off, a skew of 2 us. What is left is a misfit if it is
/// both significant (F test over the experiments of each line, Fisher's sum over the lines, 1e-4 over
/// all actuators) and 5 % of C y.
///
/// @pre record.info's excitation channels that are excited bear names of actuators; all channels are
/// known to `nominal`, and all its sensors are recorded.
ControllerCheck check_controller(HealthRecord& record, const NominalStage& nominal);

}  // namespace stageid
