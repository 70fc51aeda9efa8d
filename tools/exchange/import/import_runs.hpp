#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/exchange/import/import_signals.hpp"

namespace stageid {

/// A file of a log that is imported, with the numbers in its name.
struct ForeignFile {
  std::filesystem::path path;
  RunNumbers numbers;
};

/// A run of the log: which rows of which arrays.
struct ImportedRun {
  RunPlace place;
  ImportMap::Run run;  ///< realization and experiment from 0, rows
};

/// The files of FILE or of the map's key `files`, by their numbers.
/// @throws std::invalid_argument if none, or two of the two are given
/// @throws FileError if nothing matches a pattern
std::vector<ForeignFile> foreign_files(const std::filesystem::path& file, const ImportMap& map);

/// The runs of one file. Numbers in names of files and arrays count in their order: the smallest becomes
/// realization (experiment) 1, whether the other program counts from 0 or from 1. A realization is told by one
/// of the file's name, the arrays' names, an axis and the key runs; so is an experiment.
/// @throws FormatError naming the map
std::vector<ImportedRun> runs_of(const ArrayList& arrays, const ImportMap& map,
                                 const std::vector<ForeignFile>& files, const ForeignFile& file);

}  // namespace stageid
