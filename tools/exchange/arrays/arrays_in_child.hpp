#pragma once

#include <functional>

#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// Reads a file in a child process (in_child), for the libraries that crash on damaged files.
/// @throws FileError, FormatError
ArrayList arrays_in_child(const std::filesystem::path& file,
                          const std::function<ArrayList(const std::filesystem::path&)>& read);

}  // namespace stageid
