#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/can/can_layout.hpp"
#include "hal/stage/limits.hpp"
#include "hal/stage/stage.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {

/// How an experiment goes over CAN: sample by sample, or played by the node in its own loop.
enum class CanMode : std::uint8_t { streaming, resident };

/// The group `can` of a stage file, complete.
struct CanConfig {
  bool present = false;  ///< the file has the group
  CanMode mode = CanMode::streaming;
  CanSpec spec;
};

/// The group as it stands in the file, channels by name.
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

/// Channels by number, ranges (1.25 times the limits where the file gives none) and the node's
/// watchdog (three periods, 20 ms at least, where the file gives none).
/// @throws std::invalid_argument naming the key: an unknown channel, ranges that do not fit, no
/// limit to take a range from, and all that can_layout() refuses.
CanConfig complete_can(const CanFile& file, const StageInfo& info, const StageLimits& limits);

}  // namespace stageid
