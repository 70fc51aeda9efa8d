#pragma once

#include <filesystem>
#include <vector>

#include "tools/exchange/import/import_signals.hpp"

namespace stageid {

/// A file of an imported log, with the numbers in its name.
struct ForeignFile {
  std::filesystem::path path;
  RunNumbers numbers;
};

/// A run of the log: the arrays and rows that contain it.
struct ImportedRun {
  RunPlace place;
  ImportMap::Run run;  ///< realization and experiment from 0, rows
};

/// The files of FILE or of the key `files` of the map, sorted by their numbers.
/// @throws std::invalid_argument if neither or both are given
/// @throws FileError if no file matches a pattern
std::vector<ForeignFile> foreign_files(const std::filesystem::path& file, const ImportMap& map);

/// The runs of one file. Numbers in the names of files and arrays are ranked: the smallest becomes realization
/// (experiment) 1, whether the other program counts from 0 or from 1. The realization is given by exactly one of: the
/// name of the file, the names of the arrays, an axis, or the key `runs`; the same holds for the experiment.
/// @throws FormatError naming the map
std::vector<ImportedRun> runs_of(const ArrayList& arrays, const ImportMap& map,
                                 const std::vector<ForeignFile>& files, const ForeignFile& file);

}  // namespace stageid
