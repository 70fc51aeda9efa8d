#pragma once

#include <optional>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"

namespace stageid {

/// @throws std::invalid_argument "FLAG: got 'given'; expected RIGHT"
[[noreturn]] void refuse(const char* flag, const std::string& given, const std::string& right);

/// "FLAG: got 'word'; expected one of ..." with the nearest word
std::string wrong_word(const std::string& flag, const std::string& word,
                       const std::vector<std::string>& names);
/// @throws std::invalid_argument with that text
[[noreturn]] void refuse_word(const char* flag, const std::string& word,
                              const std::vector<std::string>& names);

/// The value with that word. @throws as refuse_word()
template <HasWords Enum>
Enum pick(const char* flag, const std::string& word) {
  const std::optional<Enum> value = from_word<Enum>(word);
  if (!value) refuse_word(flag, word, words_of<Enum>());
  return *value;
}

}  // namespace stageid
