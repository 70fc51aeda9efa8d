#pragma once

#include <optional>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// Names as arguments; None: not given.
using Names = std::optional<std::vector<std::string>>;
/// Units, one per channel; None: unknown.
using Units = std::vector<std::optional<std::string>>;

/// The names and units of `count` channels. Defaults: prefix1, prefix2, ..., and unknown units.
/// @throws std::invalid_argument "GROUP: ..." if names and units differ in number
ChannelList channels(const char* group, long count, const char* prefix, const Names& names,
                     const std::optional<Units>& units);

Units units_of(const ChannelList& channels);

}  // namespace stageid
