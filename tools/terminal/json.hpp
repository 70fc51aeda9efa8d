#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace stageid {

/// Keys in the order in which they were added: for files and for --json.
using Json = nlohmann::ordered_json;
/// Keys in the order of the alphabet: for the pages, and for groups of equal entries.
using SortedJson = nlohmann::json;

/// On one line, all other characters escaped; ill-formed UTF-8 is replaced.
template <typename AnyJson>
std::string in_ascii(const AnyJson& json) {
  return json.dump(-1, ' ', true, AnyJson::error_handler_t::replace);
}

/// Null if there is none.
template <typename Value>
Json or_null(const std::optional<Value>& value) {
  return value ? Json(*value) : Json();
}

}  // namespace stageid
