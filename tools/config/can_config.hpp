#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"
#include "hal/can/can_layout.hpp"
#include "hal/stage/limits.hpp"
#include "hal/stage/stage.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {

/// How an experiment is performed over CAN: streamed sample by sample, or by the loop of the node.
enum class CanMode : std::uint8_t { streaming, resident };
template <>
inline constexpr std::array kWords<CanMode> = {"streaming", "resident"};

/// The group `can` of a stage file with defaults filled in.
struct CanConfig {
  bool present = false;  ///< the file has the group
  CanMode mode = CanMode::streaming;
  CanSpec spec;
};

/// The group as in the file, with channels by name.
struct CanFile {
  struct Bus {
    CanBusSpec spec;
    std::vector<std::string> actuators;
    std::vector<std::string> sensors;
  };
  CanConfig config;
  double watchdog_s = 0.0;
  std::vector<Bus> buses;
  std::vector<double> actuator_range_n;
  std::vector<double> sensor_range_m;
};

/// The keys of the group.
void describe_can(ConfigVisitor& visitor, CanFile& file);

/// Fills in channel numbers, ranges (default: 1.25 times the limits) and the watchdog of the node (default: a
/// period longer than can_longest_pause_s(), at least 20 ms).
/// @throws std::invalid_argument naming the key: an unknown channel, wrong number of ranges, no limit to derive a
/// range from, a watchdog shorter than the longest pause, and as can_layout().
CanConfig complete_can(const CanFile& file, const StageInfo& info, const StageLimits& limits);

}  // namespace stageid
