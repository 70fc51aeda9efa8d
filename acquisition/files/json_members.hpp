#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

namespace stageid {

/// The finite number with this key of an external JSON value. Empty if it is missing, null or of another type, or
/// if the value is not an object. For optional figures: stageid writes null for those that it cannot compute.
template <class Json>
std::optional<double> number_in(const Json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  const double number = found->template get<double>();
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

/// The same for a list of numbers; empty if it is missing or a number is not finite.
template <class Json>
std::vector<double> numbers_in(const Json& object, const char* key) {
  std::vector<double> numbers;
  const auto found = object.find(key);
  if (found == object.end() || !found->is_array()) return numbers;
  for (const Json& entry : *found) {
    if (!entry.is_number() || !std::isfinite(entry.template get<double>())) return {};
    numbers.push_back(entry.template get<double>());
  }
  return numbers;
}

/// The same for a list of any values; empty if it is missing.
template <class Json>
Json list_in(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_array() ? *found : Json::array();
}

/// The same for text; empty if it is missing.
template <class Json>
std::string text_in(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->template get<std::string>() : "";
}

}  // namespace stageid
