#include "tools/fit/flag_values.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>

#include "acquisition/files/key_suggestion.hpp"

namespace stageid {

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
