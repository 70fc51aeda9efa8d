#include "excitation/words/words.hpp"

#include <algorithm>

namespace stageid {

const char* word_at(std::span<const char* const> words, std::size_t index,
                    const char* unknown) noexcept {
  return index < words.size() ? words[index] : unknown;
}

std::optional<std::size_t> index_of_word(std::span<const char* const> words,
                                         std::string_view word) noexcept {
  const auto found = std::ranges::find(words, word);
  if (found == words.end()) return std::nullopt;
  return static_cast<std::size_t>(found - words.begin());
}

std::string one_of(std::span<const char* const> words, const char* quote) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 < words.size() ? ", " : " or ";
    text.append(quote).append(words[i]).append(quote);
  }
  return text;
}

}  // namespace stageid
