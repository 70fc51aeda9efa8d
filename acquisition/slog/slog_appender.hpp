#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

#include "acquisition/files/file_descriptor.hpp"
#include "acquisition/slog/slog_format.hpp"

namespace stageid {

/// Appends blocks to a native log: numbers them, computes both CRCs, writes each with one call.
///
/// The file is locked (flock) against a second writer. If a block cannot be written completely, the file is
/// truncated after the last complete block, and every later call fails too.
class SlogAppender {
 public:
  /// A new file with a new log_id. @throws FileError if it exists or cannot be written.
  static SlogAppender create(const std::filesystem::path& file);

  /// An existing file, locked; continue_at() must follow.
  /// @throws FileError if it is missing, not writable, or being written.
  static SlogAppender open_existing(const std::filesystem::path& file);

  /// Truncates the file after the first `bytes` bytes, which contain whole blocks, and continues there.
  /// @throws FileError
  void continue_at(std::uint64_t bytes, std::uint32_t log_id, std::uint64_t next_sequence);

  /// Appends one block. `header` needs type, run, cols, first_row and rows; time_ns 0 means now.
  /// @throws FileError if the disk is full or fails; the message says what is kept.
  /// @throws std::invalid_argument if the payload is larger than kSlogLargestPayload.
  void append(SlogBlockHeader header, std::span<const std::byte> payload);
  void append(const SlogBlockHeader& header, std::string_view json);

  /// Flushes everything to the medium. @throws FileError, also if the file was removed.
  void synchronize();

  /// @throws FileError if the operating system reports an error of an earlier write.
  void close();

  bool is_open() const noexcept { return static_cast<bool>(file_); }
  std::uint64_t bytes() const noexcept { return bytes_; }
  const std::filesystem::path& path() const noexcept { return path_; }

 private:
  SlogAppender(std::filesystem::path path, FileDescriptor file, std::uint32_t log_id);
  void write_block(const SlogBlockHeader& header, std::span<const std::byte> payload,
                   std::size_t padding);
  void start_writeback() noexcept;
  void require_name();
  [[noreturn]] void fail(int error);

  std::filesystem::path path_;
  FileDescriptor file_;
  std::uint32_t log_id_;
  std::uint64_t bytes_ = 0;
  std::uint64_t next_sequence_ = 0;
  std::uint64_t written_back_ = 0;
  int error_ = 0;  ///< errno of the first failure
};

}  // namespace stageid
