#pragma once

#include <filesystem>
#include <string_view>

namespace stageid {

/// The name of an output for messages: a temporary file is called by the one that it becomes, also where
/// that is a temporary file itself.
std::filesystem::path shown_name(const std::filesystem::path& file);

/// An output that exists whole or not at all: write to path(), then commit() renames it onto the
/// target (after fsync). Destroyed without commit(), it removes the temporary file.
class OutputFile {
 public:
  /// @throws FileError if the directory does not exist or cannot be written.
  explicit OutputFile(const std::filesystem::path& target);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::filesystem::path& path() const noexcept { return temporary_; }

  /// @throws FileError if the file cannot be synchronized or renamed.
  void commit();

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;
  bool committed_ = false;
};

/// Removes the temporary files of all outputs that are not committed, of a process that ends now: whatever
/// begins or commits an output afterwards waits for ever.
void remove_unfinished_files();

/// Writes `text` to `target`, whole or not at all. @throws FileError
void write_text_file(const std::filesystem::path& target, std::string_view text);

}  // namespace stageid
