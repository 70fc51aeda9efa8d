#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

namespace stageid {

/// A finite number under this key of a JSON value from outside; none if it is missing, null or anything else, or
/// the value is not an object. The one way to read figures that need not be there: what could not be computed
/// is written as null.
template <class Json>
std::optional<double> number_in(const Json& object, const char* key) {
  if (!object.is_object()) return std::nullopt;
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  const double number = found->template get<double>();
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

/// The same of a list of numbers; empty if there is none, or one of them is not a finite number.
template <class Json>
std::vector<double> numbers_in(const Json& object, const char* key) {
  std::vector<double> numbers;
  if (!object.is_object()) return numbers;
  const auto found = object.find(key);
  if (found == object.end() || !found->is_array()) return numbers;
  for (const Json& entry : *found) {
    if (!entry.is_number() || !std::isfinite(entry.template get<double>())) return {};
    numbers.push_back(entry.template get<double>());
  }
  return numbers;
}

/// The same of text; empty if there is none.
template <class Json>
std::string text_in(const Json& object, const char* key) {
  if (!object.is_object()) return "";
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->template get<std::string>() : "";
}

}  // namespace stageid
