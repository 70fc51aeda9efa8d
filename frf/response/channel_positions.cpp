#include "frf/response/channel_positions.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/key_suggestion.hpp"

namespace stageid {

std::vector<Eigen::Index> channel_positions(const ChannelList& channels,
                                            const std::vector<std::string>& wanted,
                                            const char* option, const char* kind) {
  const std::vector<std::string>& names = channels.names;
  std::vector<Eigen::Index> found;
  for (const std::string& name : wanted) {
    const auto at = std::ranges::find(names, name);
    if (at == names.end()) {
      const std::string nearest = nearest_word(name, names);
      fail_request(
          "{}: unknown {} '{}'; {} {}", option, kind, name,
          nearest.empty() ? "available:" : fmt::format("did you mean '{}'? Available:", nearest),
          fmt::join(names, ", "));
    }
    found.push_back(at - names.begin());
  }
  if (std::set<Eigen::Index>(found.begin(), found.end()).size() != found.size())
    fail_request("{}: duplicate channel; name each channel once", option);
  return found;
}

ChannelList pick(const ChannelList& channels, const std::vector<Eigen::Index>& at) {
  ChannelList picked;
  for (const Eigen::Index i : at) {
    picked.names.push_back(channels.name(i));
    picked.units.push_back(channels.unit(i));
  }
  return picked;
}

}  // namespace stageid
