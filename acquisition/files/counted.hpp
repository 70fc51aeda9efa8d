#pragma once

#include <concepts>
#include <cstddef>
#include <span>
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

/// "71, 182 and 3 more": the first `most` of a list in a message.
inline std::string listed(std::span<const std::string> items, std::size_t most) {
  std::string text;
  for (std::size_t i = 0; i < items.size() && i < most; ++i)
    text.append(i > 0 ? ", " : "").append(items[i]);
  if (items.size() > most)
    text.append(" and ").append(std::to_string(items.size() - most)).append(" more");
  return text;
}

}  // namespace stageid
