#include "tools/channel_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>

#include "tools/key_suggestion.hpp"

namespace stageid {

void require_known(const char* option, const char* kind, const std::vector<std::string>& wanted,
                   const ChannelList& channels) {
  const std::vector<std::string>& names = channels.names;
  for (const std::string& name : wanted) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    const std::string nearest = nearest_word(name, names);
    throw std::invalid_argument(fmt::format(
        "{}: unknown {} '{}'; {} {}", option, kind, name,
        nearest.empty() ? "there are" : fmt::format("did you mean '{}'? There are", nearest),
        fmt::join(names, ", ")));
  }
}

}  // namespace stageid
