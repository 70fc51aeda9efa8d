#pragma once

#include <cmath>
#include <optional>
#include <string>

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

/// The same of text; empty if there is none.
template <class Json>
std::string text_in(const Json& object, const char* key) {
  if (!object.is_object()) return "";
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->template get<std::string>() : "";
}

}  // namespace stageid
