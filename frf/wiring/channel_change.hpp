#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "frf/periods/health_finding.hpp"
#include "frf/runs/health_record.hpp"

namespace stageid {

/// A cause that makes a recorded channel another one than its name says:
///   gain: recorded = value * true;   skew: recorded(t) = true(t - value);
///   swap: a and b bear each other's name.
struct ChannelChange {
  enum class Kind : std::uint8_t { gain, swap, skew };
  Kind kind = Kind::gain;
  bool of_sensors = true;  ///< else of actuators
  Eigen::Index a = -1;     ///< -1: all of them
  Eigen::Index b = -1;     ///< swap only
  double value = 1.0;      ///< factor, or s
  double deviation = 0.0;  ///< standard deviation of value; 0: unknown
};

/// Undoes the change in the record's spectra.
void undo(const ChannelChange& change, HealthRecord& record);

/// "a3", "a3 a7", "all sensors".
std::string channel_names(const ChannelChange& change, const LogInfo& info);

/// The change told to people. `in_recording`: seen between the recorded signals; else behind them, at
/// the stage.
Finding to_finding(const ChannelChange& change, const LogInfo& info, bool in_recording);

}  // namespace stageid
