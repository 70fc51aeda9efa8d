#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stageid {

/// The whole text as a finite number; empty if it is not one.
std::optional<double> to_number(std::string_view text);

/// @throws std::invalid_argument "FLAG: 'given'; write RIGHT"
[[noreturn]] void refuse(const char* flag, const std::string& given, const std::string& right);

/// The words of an enumeration up to `last`, in the order of its values, from to_string().
template <typename Enum>
std::vector<std::string> words_to(Enum last) {
  std::vector<std::string> words;
  for (int i = 0; i <= static_cast<int>(last); ++i)
    words.emplace_back(to_string(static_cast<Enum>(i)));
  return words;
}
/// The same without `end`.
template <typename Enum>
std::vector<std::string> words_before(Enum end) {
  std::vector<std::string> words = words_to(end);
  words.pop_back();
  return words;
}

/// @throws std::invalid_argument "FLAG: 'word'; write one of ..." with the nearest word
[[noreturn]] void refuse_word(const char* flag, const std::string& word,
                              const std::vector<std::string>& names);

/// The enumerator at the index of its name in `names`. @throws as refuse_word()
template <typename Enum>
Enum pick(const char* flag, const std::string& word, const std::vector<std::string>& names) {
  const auto found = std::find(names.begin(), names.end(), word);
  if (found == names.end()) refuse_word(flag, word, names);
  return static_cast<Enum>(found - names.begin());
}

}  // namespace stageid
