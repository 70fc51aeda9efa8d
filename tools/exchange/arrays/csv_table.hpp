#pragma once

#include <filesystem>
#include <string>

#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// The columns of a text table as arrays. Fields are separated by comma, semicolon, tab or blanks: by that
/// which the first line has, in this order after tab and semicolon; quotes may stand around them, and with
/// semicolons a comma may be the decimal sign. Lines that begin with # or % are left out. A first line that
/// is not all numbers names the columns; else they are 1, 2, ... A column may end before the others.
/// @throws FileError, FormatError "FILE:LINE: ..."
ArrayList read_csv(const std::filesystem::path& file);

/// A field of a table that commas separate, in quotes if it must be.
std::string csv_field(const std::string& text);

}  // namespace stageid
