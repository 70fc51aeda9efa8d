#pragma once

#include <vector>

#include "frf/runs/health_record.hpp"
#include "frf/wiring/channel_error.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// An actuator that does not follow excitation and controller.
struct ControllerMisfit {
  Eigen::Index actuator = 0;
  double relative = 0.0;   ///< |u - r + C y| / |C y| over the lines; / |u| without control
  bool controlled = true;  ///< C y is not zero
  bool of_all = false;     ///< most actuators are affected, so the controller is the cause
};

struct RecordedChannelsCheck {
  std::vector<ChannelError> errors;       ///< ordered by what they explain; undone in the record
  std::vector<ControllerMisfit> misfits;  ///< not explained by an error of one channel
};

/// Checks u = r - C y between the recorded signals, line by line (S + T = I with S = U R^-1 and T = C Y R^-1). If it is
/// violated, searches for the wrongly recorded channels that explain it.
///
/// All is judged by the deviation of every three neighbouring lines from a straight line. Where the record does not
/// repeat, the controller's states at its two ends differ, and what they leave in E is smooth over the lines; the
/// spectra of a multisine have random phases.
///
/// Let E = U - R + C Y with means over the periods, and weights w = 1 / (s^2 + (epsilon C Y)^2), s^2 the variance of E
/// from its scatter over periods. Every error of one channel moves E along one direction X: E - d X, d real. Least
/// squares give d, its standard deviation (2 |X|_w^2)^(-1/2), and the explained part of |E|_w^2. The exchange of two
/// channels has no parameter. The error that explains most is undone, and the search is repeated.
///
/// An error is accepted on three conditions:
///   - d is 6 standard deviations from zero. False alarms: 2e-9 per candidate, 6e-7 for the 300 candidates of a wafer
///     stage.
///   - It explains 30 % of the affected misfit.
///   - It is large enough to matter: 2 % for a gain, 2 us for a skew.
/// The rest is a misfit if it is both significant (F test over the experiments, Fisher's sum, 1e-4 over all actuators)
/// and 5 % of C y.
///
/// @pre the excited excitation channels of record.info have names of actuators; all channels are known to `nominal`,
/// and all its sensors are recorded.
RecordedChannelsCheck check_recorded_channels(HealthRecord& record, const NominalStage& nominal);

/// Whether u = r - C y holds, without a search: the same F test, with the error of the model of the controller
/// added to the noise, and for any size. @pre as check_recorded_channels()
bool follows_controller(HealthRecord& record, const NominalStage& nominal);

/// Power of what does not repeat in u - r + C y, relative to that in C y: below one where u answers to y (it is not near
/// zero, because single periods leak), one where u does not answer to a slow motion, as of a setpoint.
/// @pre as check_recorded_channels()
double unexplained_motion(HealthRecord& record, const NominalStage& nominal);

}  // namespace stageid
