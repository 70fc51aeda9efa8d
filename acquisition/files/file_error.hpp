#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace stageid {

/// The operating system failed to read or write a file: missing, unreadable, disk full. Exit code 1.
class FileError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A file was read but has unexpected content: damaged, wrong format, wrong shape, NaN instead of
/// numbers. Exit code 2.
///
/// what() is one line "FILE[:LINE:COLUMN or /dataset]: problem; remedy".
class FormatError : public std::runtime_error {
 public:
  FormatError(const std::filesystem::path& file, const std::string& place,
              const std::string& wrong_and_remedy)
      : std::runtime_error(file.string() + (place.empty() ? "" : ":" + place) + ": " +
                           wrong_and_remedy) {}
  /// With the what() of another one.
  explicit FormatError(const std::string& what) : std::runtime_error(what) {}
};

}  // namespace stageid
