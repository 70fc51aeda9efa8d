#include "hal/can/can_layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "excitation/words/require.hpp"

namespace stageid {
namespace {

constexpr std::size_t kLargestFrameCount = 128;  // identifiers between 0x100 and 0x180

bool is_positive(double value) { return value > 0.0 && std::isfinite(value); }

void check_bus(const CanBusSpec& bus) {
  require(!bus.interface.empty(), "can: a bus has no interface; set its interface");
  require(is_positive(bus.nominal_bit_rate_hz) && is_positive(bus.data_bit_rate_hz),
          "can: bus {}: the bit rates must be positive", bus.interface);
}

void check_times(const CanSpec& spec) {
  require(!spec.buses.empty(), "can: at least one bus is required");
  std::set<std::string> interfaces;
  for (const CanBusSpec& bus : spec.buses) {
    check_bus(bus);
    require(interfaces.insert(bus.interface).second, "can: duplicate interface {}", bus.interface);
  }
  require(is_positive(spec.reply_timeout_s) && is_positive(spec.watchdog_s),
          "can: reply_timeout_s and watchdog_s must be positive");
  require(spec.largest_load > 0.0 && spec.largest_load <= 1.0,
          "can: largest_load must be between 0 and 1");
}

void check_once(const CanSpec& spec, const std::vector<Channel>& channels,
                std::vector<int> CanBusSpec::*of_bus) {
  std::vector<std::string> place(channels.size());
  for (const CanBusSpec& bus : spec.buses)
    for (const int channel : bus.*of_bus) {
      const auto index = static_cast<std::size_t>(channel);
      require(index < channels.size(), "can: bus {}: unknown channel number {}", bus.interface,
              channel);
      require(place[index].empty(),
              "can: channel '{}' is assigned to both {} and {}; assign it to one bus",
              channels[index].name, place[index], bus.interface);
      place[index] = bus.interface;
    }
  for (std::size_t i = 0; i < place.size(); ++i)
    require(!place[i].empty(), "can: channel '{}' is not assigned to a bus", channels[i].name);
}

std::vector<CanScale> scales(const std::vector<double>& ranges,
                             const std::vector<Channel>& channels) {
  require(ranges.size() == channels.size(),
          "can: {} ranges for {} channels; give one range per channel", ranges.size(),
          channels.size());
  std::vector<CanScale> list;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    require(is_positive(ranges[i]), "can: channel '{}': the range must be positive; got {}",
            channels[i].name, ranges[i]);
    list.push_back({ranges[i] / kCanCountsOfRange});
  }
  return list;
}

std::vector<CanValueFrame> frames(const CanSpec& spec, std::vector<int> CanBusSpec::*of_bus,
                                  std::uint16_t first_id) {
  std::vector<CanValueFrame> list;
  for (std::size_t bus = 0; bus < spec.buses.size(); ++bus) {
    const std::vector<int>& channels = spec.buses[bus].*of_bus;
    for (std::size_t at = 0; at < channels.size(); at += kCanValuesOfFrame) {
      require(list.size() < kLargestFrameCount,
              "can: too many frames for the available identifiers; use fewer buses");
      const auto from = channels.begin() + at;
      const auto count = std::min(kCanValuesOfFrame, channels.size() - at);
      list.push_back({static_cast<std::uint16_t>(first_id + list.size()),
                      static_cast<std::uint8_t>(bus),
                      {from, from + static_cast<std::ptrdiff_t>(count)}});
    }
  }
  return list;
}

std::string describe(const std::vector<CanValueFrame>& list, const std::vector<Channel>& channels,
                     const std::vector<CanScale>& scale) {
  std::string text;
  for (const CanValueFrame& frame : list) {
    text += fmt::format("{:x}:", frame.id);
    for (const std::size_t channel : frame.channels)
      text += fmt::format("{} {:.17g};", channels[channel].name, scale[channel].si_per_count);
  }
  return text;
}

// FNV-1a, 32 bit. Source: Fowler, Noll, Vo; draft-eastlake-fnv.
std::uint32_t hash(const std::string& text) {
  std::uint32_t value = 2166136261U;
  for (const char c : text) value = (value ^ static_cast<std::uint8_t>(c)) * 16777619U;
  return value;
}

std::vector<std::uint16_t> identifiers(const std::vector<CanValueFrame>& frames,
                                       std::vector<std::uint16_t> others) {
  for (const CanValueFrame& frame : frames) others.push_back(frame.id);
  return others;
}

}  // namespace

std::vector<std::uint16_t> can_host_identifiers(const CanLayout& layout) {
  return identifiers(layout.sensors, {kCanStateId, kCanTextId, kCanDownloadId, kCanMissingId});
}

std::vector<std::uint16_t> can_node_identifiers(const CanLayout& layout) {
  return identifiers(layout.setpoints, {kCanCommandId, kCanUploadId});
}

double can_longest_pause_s(const CanSpec& spec, const StageInfo& info) {
  const double period_s = 1.0 / info.sample_rate_hz;
  return period_s + (info.clock == Clock::wall ? period_s : kCanRepeats * spec.reply_timeout_s);
}

CanLayout can_layout(const CanSpec& spec, const StageInfo& info) {
  check_times(spec);
  check_once(spec, info.actuators, &CanBusSpec::actuators);
  check_once(spec, info.sensors, &CanBusSpec::sensors);
  CanLayout layout;
  layout.actuator_scale = scales(spec.actuator_range_n, info.actuators);
  layout.sensor_scale = scales(spec.sensor_range_m, info.sensors);
  layout.setpoints = frames(spec, &CanBusSpec::actuators, kCanSetpointId);
  layout.sensors = frames(spec, &CanBusSpec::sensors, kCanSensorId);
  layout.fingerprint =
      hash(fmt::format("{:.17g};{}{}", info.sample_rate_hz,
                       describe(layout.setpoints, info.actuators, layout.actuator_scale),
                       describe(layout.sensors, info.sensors, layout.sensor_scale)));
  return layout;
}

}  // namespace stageid
