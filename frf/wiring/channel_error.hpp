#pragma once

#include <Eigen/Core>

#include "frf/periods/realization_change.hpp"
#include "frf/runs/health_record.hpp"

namespace stageid {

/// A recording or wiring error of a channel:
///   gain: recorded = value * true;   skew: recorded(t) = true(t - value);
///   swap: the names of a and b are exchanged.
struct ChannelError {
  using Kind = RealizationChange::Kind;
  Kind kind = Kind::gain;
  bool of_sensors = true;  ///< otherwise of actuators
  Eigen::Index a = -1;     ///< -1: all channels
  Eigen::Index b = -1;     ///< swap only
  double value = 1.0;      ///< factor, or s
  double deviation = 0.0;  ///< standard deviation of value; 0: unknown
};

/// Undoes the error in the record's spectra.
void undo(const ChannelError& error, HealthRecord& record);

/// undo() of it restores what undo() of the error altered.
ChannelError inverse(ChannelError error);

/// The error as a finding. `in_recording`: between the recorded signals; otherwise between recorder and stage.
Finding to_finding(const ChannelError& error, const LogInfo& info, bool in_recording);

}  // namespace stageid
