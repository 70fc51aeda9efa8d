#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace stageid {

/// The world failed while a file was read or written: missing, unreadable, disk full. Exit code 1.
class FileError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A file could be read but is not what it should be: damaged, wrong format, wrong shape, NaN where
/// numbers must stand. Exit code 2.
///
/// what() is one line "FILE[:LINE:COLUMN or /dataset]: what is wrong; what would be right".
class FormatError : public std::runtime_error {
 public:
  FormatError(const std::filesystem::path& file, const std::string& place,
              const std::string& wrong_and_remedy)
      : std::runtime_error(file.string() + (place.empty() ? "" : ":" + place) + ": " +
                           wrong_and_remedy) {}
};

}  // namespace stageid
