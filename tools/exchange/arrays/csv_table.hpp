#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// The columns of a text table as arrays. The separator is the first of tab, semicolon and comma that the first line
/// contains, else blanks. Fields may be quoted. With semicolons, a comma may be the decimal sign. Lines that begin
/// with # or % are ignored. The first line contains the names of the columns unless all its fields are numbers; the
/// names are then 1, 2, ... Columns may have different lengths.
/// @throws FileError, FormatError "FILE:LINE: ..."
ArrayList read_csv(const std::filesystem::path& file);

/// A table of texts: the first line has the names of the columns.
struct TextTable {
  std::vector<std::string> names;
  std::vector<std::vector<std::string>>
      rows;  ///< each with as many fields as names, without blanks around them
  std::vector<std::size_t> lines;  ///< per row its line in the file, 1-based
};

/// Separators, quotes and comments as in read_csv(). @throws FileError, FormatError "FILE:LINE: ..."
TextTable read_text_table(const std::filesystem::path& file);

/// A field of a comma-separated table, quoted if necessary.
std::string csv_field(const std::string& text);

}  // namespace stageid
