#include "tools/python/channels.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "acquisition/files/counted.hpp"

namespace stageid {

ChannelList channels(const char* group, long count, const char* prefix, const Names& names,
                     const std::optional<Units>& units) {
  ChannelList list;
  if (names) list.names = *names;
  if (!names)
    for (long c = 1; c <= count; ++c) list.names.push_back(fmt::format("{}{}", prefix, c));
  list.units.resize(list.size());
  if (!units) return list;
  if (units->size() != list.size())
    throw std::invalid_argument(fmt::format("{}: {} for {}; give one per channel", group,
                                            counted(units->size(), "unit"),
                                            counted(list.size(), "channel")));
  for (std::size_t c = 0; c < list.size(); ++c) list.units[c] = (*units)[c].value_or("");
  return list;
}

Units units_of(const ChannelList& channels) {
  Units units(channels.size());
  for (std::size_t c = 0; c < channels.units.size() && c < units.size(); ++c)
    if (!channels.units[c].empty()) units[c] = channels.units[c];
  return units;
}

}  // namespace stageid
