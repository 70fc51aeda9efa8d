#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>

#include "acquisition/files/file_error.hpp"

namespace stageid {

// Errors with a formatted message. A call that sets errno comes before: the order in which arguments are computed is not
// defined.

/// @throws std::invalid_argument always: the request is invalid.
template <typename... Parts>
[[noreturn]] void fail_request(fmt::format_string<Parts...> what, Parts&&... parts) {
  throw std::invalid_argument(fmt::format(what, std::forward<Parts>(parts)...));
}

/// @throws FileError "FILE: WHAT" always.
template <typename... Parts>
[[noreturn]] void fail_file(const std::filesystem::path& file, fmt::format_string<Parts...> what,
                            Parts&&... parts) {
  throw FileError(file.string() + ": " + fmt::format(what, std::forward<Parts>(parts)...));
}

/// @throws FormatError always.
template <typename... Parts>
[[noreturn]] void fail_format(const std::filesystem::path& file, const std::string& place,
                              fmt::format_string<Parts...> what, Parts&&... parts) {
  throw FormatError(file, place, fmt::format(what, std::forward<Parts>(parts)...));
}

}  // namespace stageid
