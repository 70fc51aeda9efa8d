#include "tools/fit/flag_values.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/key_suggestion.hpp"

namespace stageid {

void refuse(const char* flag, const std::string& given, const std::string& right) {
  fail_request("{}: got '{}'; expected {}", flag, given, right);
}

std::string wrong_word(const std::string& flag, const std::string& word,
                       const std::vector<std::string>& names) {
  return fmt::format("{}: got '{}'; expected one of {}{}", flag, word, fmt::join(names, ", "),
                     nearest_hint(word, names));
}

void refuse_word(const char* flag, const std::string& word, const std::vector<std::string>& names) {
  throw std::invalid_argument(wrong_word(flag, word, names));
}

}  // namespace stageid
