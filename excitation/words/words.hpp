#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace stageid {

/// The words of an enumeration in files, flags, keys and messages, in the order of its values 0, 1, 2 ... They are
/// specialized next to the enumeration:
///
///   enum class Clock : std::uint8_t { virtual_time, wall };
///   template <>
///   inline constexpr std::array kWords<Clock> = {"virtual", "wall"};
template <typename Enum>
inline constexpr std::array<const char*, 0> kWords = {};

template <typename Enum>
concept HasWords = std::is_enum_v<Enum> && !kWords<Enum>.empty();

/// @returns the word at `index`; `unknown` if the table is shorter
const char* word_at(std::span<const char* const> words, std::size_t index,
                    const char* unknown) noexcept;

std::optional<std::size_t> index_of_word(std::span<const char* const> words,
                                         std::string_view word) noexcept;

/// "none, delay or hold", or with quotes "'none', 'delay' or 'hold'".
std::string one_of(std::span<const char* const> words, const char* quote = "");

/// @returns "unknown" for a value that is not in the table, such as one from a damaged file
template <HasWords Enum>
const char* to_string(Enum value) noexcept {
  return word_at(kWords<Enum>, static_cast<std::size_t>(value), "unknown");
}

template <HasWords Enum>
std::optional<Enum> from_word(std::string_view word) noexcept {
  const std::optional<std::size_t> index = index_of_word(kWords<Enum>, word);
  return index ? std::optional(static_cast<Enum>(*index)) : std::nullopt;
}

template <HasWords Enum>
std::vector<std::string> words_of() {
  return {kWords<Enum>.begin(), kWords<Enum>.end()};
}

/// The words of the values below `end`.
template <HasWords Enum>
std::vector<std::string> words_before(Enum end) {
  return {kWords<Enum>.begin(), kWords<Enum>.begin() + static_cast<std::ptrdiff_t>(end)};
}

}  // namespace stageid
