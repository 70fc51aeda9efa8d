#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// Index of each of `wanted` in `channels`.
/// @param option, kind for messages: "inputs", "actuator"
/// @throws std::invalid_argument "OPTION: unknown KIND 'x'; did you mean 'y'? ...", or if a channel is named
///         twice
std::vector<Eigen::Index> channel_positions(const ChannelList& channels,
                                            const std::vector<std::string>& wanted,
                                            const char* option, const char* kind);

/// The channels at these indices.
ChannelList pick(const ChannelList& channels, const std::vector<Eigen::Index>& at);

}  // namespace stageid
