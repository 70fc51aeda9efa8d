#include "hal/modbus/modbus_map.hpp"

#include <fmt/format.h>

#include "excitation/words/require.hpp"

namespace stageid::modbus_map {
void require_channels(const StageInfo& info) {
  require(info.actuators.size() <= kMostChannels && info.sensors.size() <= kMostChannels,
          "modbus: {} actuators and {} sensors; one transaction carries at most {} of each",
          info.actuators.size(), info.sensors.size(), kMostChannels);
}

std::uint32_t channel_hash(const StageInfo& info) {
  std::uint32_t hash = 0x811C9DC5U;
  for (const auto* channels : {&info.actuators, &info.sensors})
    for (const Channel& channel : *channels)
      for (const char c : fmt::format("{} {}\n", channel.name, channel.unit))
        hash = (hash ^ static_cast<unsigned char>(c)) * 0x01000193U;
  return hash;
}

}  // namespace stageid::modbus_map
