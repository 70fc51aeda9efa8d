#pragma once

#include <nlohmann/json.hpp>
#include <optional>

namespace stageid {

/// Keys in the order in which they were added: for files and for --json.
using Json = nlohmann::ordered_json;
/// Keys in the order of the alphabet: for the pages.
using SortedJson = nlohmann::json;

/// Null if there is none.
template <typename Value>
Json or_null(const std::optional<Value>& value) {
  return value ? Json(*value) : Json();
}

}  // namespace stageid
