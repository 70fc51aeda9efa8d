#include "hal/stage/stage.hpp"

namespace stageid {

bool is_rotation(const Channel& channel) noexcept {
  return channel.unit == "Nm" || channel.unit == "rad" || channel.unit == "rad/s^2";
}

bool is_acceleration(const Channel& channel) noexcept {
  return channel.unit == "m/s^2" || channel.unit == "rad/s^2";
}

std::string common_unit(const std::vector<Channel>& channels) {
  for (const Channel& channel : channels)
    if (channel.unit != channels.front().unit) return "";
  return channels.empty() ? "" : " " + channels.front().unit;
}

int channel_index(const std::vector<Channel>& channels, const std::string& name) noexcept {
  for (std::size_t i = 0; i < channels.size(); ++i)
    if (channels[i].name == name) return static_cast<int>(i);
  return -1;
}

const char* to_string(Outcome outcome) noexcept {
  switch (outcome) {
    case Outcome::ok:
      return "ok";
    case Outcome::late:
      return "late";
    case Outcome::incomplete:
      return "incomplete";
    case Outcome::stale:
      return "stale";
    case Outcome::corrupt:
      return "corrupt";
    case Outcome::bus_passive:
      return "bus passive";
    case Outcome::bus_off:
      return "bus off";
    case Outcome::link_down:
      return "link down";
    case Outcome::fault:
      return "fault";
    case Outcome::limit:
      return "limit";
    case Outcome::braking:
      return "braking";
    case Outcome::opened:
      return "opened";
  }
  return "unknown outcome";
}

const char* to_string(NodeState state) noexcept {
  switch (state) {
    case NodeState::not_ready:
      return "not ready";
    case NodeState::switch_on_disabled:
      return "switch on disabled";
    case NodeState::ready:
      return "ready";
    case NodeState::switched_on:
      return "switched on";
    case NodeState::operation_enabled:
      return "operation enabled";
    case NodeState::measuring:
      return "measuring";
    case NodeState::quick_stop:
      return "quick stop";
    case NodeState::fault_reaction:
      return "fault reaction";
    case NodeState::fault:
      return "fault";
  }
  return "unknown state";
}

}  // namespace stageid
