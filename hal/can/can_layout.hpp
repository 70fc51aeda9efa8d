#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/can/can_frame.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// One CAN FD bus and its channels. The first bus also carries commands, states and transfers.
struct CanBusSpec {
  std::string interface;  ///< "can0"
  double nominal_bit_rate_hz = 1e6;
  double data_bit_rate_hz = 5e6;
  std::vector<int> actuators;  ///< indices
  std::vector<int> sensors;
};

/// A stage connected by CAN.
struct CanSpec {
  std::vector<CanBusSpec> buses;
  std::vector<double> actuator_range_n;  ///< one per actuator: 2^23 counts
  std::vector<double> sensor_range_m;    ///< one per sensor
  /// Time that the host waits for the answer of a cycle if the loop sets no deadline.
  double reply_timeout_s = 5e-3;
  /// The node stops by itself after this time without a setpoint.
  double watchdog_s = 20e-3;
  /// The node samples by its own clock and sets the pace of the host, on the wall clock.
  bool node_clock = false;
  double largest_load = 0.8;  ///< largest permitted load of a bus
};

/// In virtual time, a setpoint without an answer is sent again so often.
inline constexpr int kCanRepeats = 3;

/// Longest time between two new setpoints of a run that continues. On the wall clock, one setpoint was lost; in
/// virtual time, one was repeated every reply_timeout_s. The watchdog of a node must be longer.
double can_longest_pause_s(const CanSpec& spec, const StageInfo& info);

// Lower identifiers have priority on the bus.
inline constexpr std::uint16_t kCanCommandId = 0x080;
inline constexpr std::uint16_t kCanSetpointId = 0x100;  ///< + number of the frame
inline constexpr std::uint16_t kCanSensorId = 0x180;    ///< + number of the frame
inline constexpr std::uint16_t kCanStateId = 0x200;
inline constexpr std::uint16_t kCanTextId = 0x201;
inline constexpr std::uint16_t kCanUploadId = 0x300;
inline constexpr std::uint16_t kCanDownloadId = 0x380;
inline constexpr std::uint16_t kCanMissingId = 0x381;
inline constexpr std::size_t kCanValuesOfFrame = 18;  ///< (64 - 8) / 3

/// A frame of setpoints or measurements: its channels, in order, with three bytes each.
struct CanValueFrame {
  std::uint16_t id = 0;
  std::uint8_t bus = 0;
  std::vector<std::size_t> channels;
  std::size_t payload_bytes() const noexcept { return kCanCountBytes * channels.size(); }
};

/// The position of each channel in the frames. Host and node compute it from the same stage file.
struct CanLayout {
  std::vector<CanValueFrame> setpoints;
  std::vector<CanValueFrame> sensors;
  std::vector<CanScale> actuator_scale;
  std::vector<CanScale> sensor_scale;
  /// Hash of all settings that both sides must share: rate, frames, channels by name, scaling.
  std::uint32_t fingerprint = 0;
};

/// @throws std::invalid_argument naming the bus or channel: a channel on no bus or on two, a range
/// that is not positive, more frames than identifiers, invalid times or rates.
CanLayout can_layout(const CanSpec& spec, const StageInfo& info);

/// The identifiers that the host and the node receive.
std::vector<std::uint16_t> can_host_identifiers(const CanLayout& layout);
std::vector<std::uint16_t> can_node_identifiers(const CanLayout& layout);

}  // namespace stageid
