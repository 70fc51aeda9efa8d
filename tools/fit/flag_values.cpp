#include "tools/fit/flag_values.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <cmath>
#include <stdexcept>

#include "acquisition/files/key_suggestion.hpp"

namespace stageid {

std::optional<double> to_number(std::string_view text) {
  double value = 0.0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || stop != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

void refuse(const char* flag, const std::string& given, const std::string& right) {
  throw std::invalid_argument(fmt::format("{}: got '{}'; expected {}", flag, given, right));
}

void refuse_word(const char* flag, const std::string& word, const std::vector<std::string>& names) {
  const std::string nearest = nearest_word(word, names);
  refuse(flag, word,
         fmt::format("one of {}{}", fmt::join(names, ", "),
                     nearest.empty() ? "" : fmt::format(" (did you mean '{}'?)", nearest)));
}

bool is_second(const char* flag, const std::string& word, const std::vector<std::string>& two) {
  if (word != two[0] && word != two[1]) refuse_word(flag, word, two);
  return word == two[1];
}

}  // namespace stageid
