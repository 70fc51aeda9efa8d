#pragma once

#include <filesystem>
#include <string_view>

namespace stageid {

/// The name of an output for messages: for a temporary file, that of its target. It is resolved repeatedly, in
/// case the target is a temporary file too.
std::filesystem::path shown_name(const std::filesystem::path& file);

/// An output that is written completely or not at all. Write to path(); commit() then renames it to the target
/// (after fsync). Without commit(), the destructor removes the temporary file. note_output() knows the target.
class OutputFile {
 public:
  /// @throws FileError if the directory does not exist or cannot be written; std::invalid_argument if the target was
  /// read and inputs are protected.
  explicit OutputFile(const std::filesystem::path& target);
  ~OutputFile();
  OutputFile(OutputFile&&) = delete;

  const std::filesystem::path& path() const noexcept { return temporary_; }

  /// Adds to the temporary file. @throws FileError
  void append(std::string_view text);

  /// @throws FileError if the file cannot be synchronized or renamed.
  void commit();

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;
  bool committed_ = false;
};

/// Removes the temporary files of all outputs that are not committed, in a process that is about to end. Later
/// calls that begin or commit an output block forever.
void remove_unfinished_files();

/// Writes `text` to `target`, completely or not at all. @throws FileError
void write_text_file(const std::filesystem::path& target, std::string_view text);

}  // namespace stageid
