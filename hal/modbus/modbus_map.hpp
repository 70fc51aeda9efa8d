#pragma once

#include <cstdint>

#include "hal/stage/stage.hpp"

namespace stageid {

/// The register map of a stage behind Modbus: 0-based addresses of holding registers, as transmitted. It is
/// documented in docs/modbus-map.md; a test compares both.
///
/// A write is a request only if its sequence number is new. A duplicate changes nothing and gets the same
/// answer, so a request whose reply was lost may be sent again.
///
/// A run belongs to the connection that began it and to the key that it received. Other writes to the run's
/// registers are refused and change nothing.
namespace modbus_map {

inline constexpr std::uint32_t kMagicValue = 0x53544749;  // "STGI"
inline constexpr std::uint32_t kVersionValue = 2;
inline constexpr int kMostChannels = 56;  // limit of one FC23: 116 registers written, 124 read
inline constexpr int kMostPanelValues = 8;

// Written by the supervising host.
inline constexpr int kHeartbeat = 0;
inline constexpr int kCommand = 2;  // SupervisorCommand + 1
inline constexpr int kCommandSequence = 4;
inline constexpr int kSupervisorRegisters = 6;
// Written by the measuring host: begin and end of a run.
inline constexpr int kRunCommand = 16;
inline constexpr int kRunSequence = 18;
inline constexpr int kRunSeed = 20;
inline constexpr int kRunKey = 24;  // to end a run, and with every sample
inline constexpr int kRunRegisters = 10;
// Written by the measuring host: one sample, from kRunKey on.
inline constexpr int kSetpointSequence = 26;
inline constexpr int kSetpoint = 28;
inline constexpr int kWritableEnd = kSetpoint + 2 * kMostChannels;
// Status, read by the supervising host.
inline constexpr int kMagic = 200;
inline constexpr int kVersion = 202;
inline constexpr int kBootId = 204;
inline constexpr int kHeartbeatEcho = 206;
inline constexpr int kState = 208;
inline constexpr int kCause = 210;
inline constexpr int kFlags = 212;
inline constexpr int kCommandEcho = 214;
inline constexpr int kCommandReply = 216;
inline constexpr int kGravityCount = 218;
inline constexpr int kTemperatureCount = 220;
inline constexpr int kGravity = 222;
inline constexpr int kTemperature = kGravity + 2 * kMostPanelValues;
inline constexpr int kStatusRegisters = kTemperature + 2 * kMostPanelValues - kMagic;
// Measurement, read by the measuring host.
inline constexpr int kMeasurementBootId = 300;
inline constexpr int kMeasurementSequence = 302;
inline constexpr int kSession = 304;
inline constexpr int kMeasurementStatus = 306;
inline constexpr int kValid = 308;
inline constexpr int kMeasurement = 312;
// Description, read once.
inline constexpr int kActuatorCount = 500;
inline constexpr int kSensorCount = 502;
inline constexpr int kSampleRate = 504;
inline constexpr int kChannelHash = 506;
inline constexpr int kActuatorScale = 508;
inline constexpr int kSensorScale = kActuatorScale + 2 * kMostChannels;
inline constexpr int kEnd = kSensorScale + 2 * kMostChannels;

inline constexpr std::uint32_t kRunBegin = 1;
inline constexpr std::uint32_t kRunEnd = 2;
inline constexpr std::uint32_t kFlagInterlockClosed = 1U << 0;
inline constexpr std::uint32_t kFlagEnabled = 1U << 1;
inline constexpr std::uint32_t kReplyAccepted = 1;
inline constexpr std::uint32_t kReplyRefused = 2;

/// @throws std::invalid_argument if there are more channels than one transaction carries.
void require_channels(const StageInfo& info);

/// FNV-1a over "NAME UNIT\n" of all actuators, then sensors. It detects hosts with other channels or another
/// order.
std::uint32_t channel_hash(const StageInfo& info);

}  // namespace modbus_map

}  // namespace stageid
