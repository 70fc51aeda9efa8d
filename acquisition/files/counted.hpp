#pragma once

#include <concepts>
#include <string>
#include <string_view>

namespace stageid {

/// "1 experiment", "3 experiments": a count in a message.
/// @param plural if it is not the noun with an s
std::string counted(std::integral auto count, std::string_view noun, std::string_view plural = {}) {
  std::string text = std::to_string(count) + " ";
  if (count == 1) return text.append(noun);
  return plural.empty() ? text.append(noun) + "s" : text.append(plural);
}

}  // namespace stageid
