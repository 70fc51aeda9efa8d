#pragma once

#include <string>

namespace stageid {

/// A text in single quotes, as one word of a shell command.
inline std::string shell_word(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

}  // namespace stageid
