#pragma once

#include <string>
#include <vector>

#include "acquisition/log_reader.hpp"

namespace stageid {

/// That channels asked for by name are there.
/// @throws std::invalid_argument "OPTION: unknown KIND 'x'; did you mean 'y'? There are ..."
void require_known(const char* option, const char* kind, const std::vector<std::string>& wanted,
                   const ChannelList& channels);

}  // namespace stageid
