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

bool all_finite(std::span<const double> values) noexcept {
  double sum = 0.0;  // 0 times a finite number is 0, otherwise NaN
  for (const double value : values) sum += 0.0 * value;
  return sum == 0.0;
}

int channel_index(const std::vector<Channel>& channels, const std::string& name) noexcept {
  for (std::size_t i = 0; i < channels.size(); ++i)
    if (channels[i].name == name) return static_cast<int>(i);
  return -1;
}

const char* to_string(Outcome outcome) noexcept {
  return word_at(kWords<Outcome>, static_cast<std::size_t>(outcome), "unknown outcome");
}

const char* to_string(NodeState state) noexcept {
  return word_at(kWords<NodeState>, static_cast<std::size_t>(state), "unknown state");
}

}  // namespace stageid
