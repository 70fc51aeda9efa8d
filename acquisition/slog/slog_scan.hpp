#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "acquisition/slog/slog_appender.hpp"
#include "acquisition/slog/slog_format.hpp"

namespace stageid {

/// A native log opened for random access by any number of threads.
class SlogSource {
 public:
  /// @throws FileError if the file is missing or cannot be read.
  explicit SlogSource(std::filesystem::path file);

  const std::filesystem::path& path() const noexcept { return path_; }
  std::uint64_t bytes() const noexcept { return bytes_; }
  void update_bytes();  ///< of a file that is being written. @throws FileError

  /// Reads exactly `size` bytes starting at `offset`.
  /// @throws FileError if the device fails or the file has become shorter.
  void read(std::uint64_t offset, void* to, std::size_t size) const;

  /// Reads the bytes [from, end) in pieces of bounded size.
  using Take = std::function<void(std::span<const std::byte>)>;
  void read_pieces(std::uint64_t from, std::uint64_t end, const Take& take) const;

  /// posix_fadvise(): how the file will be read.
  void advise(int advice) const noexcept;

 private:
  std::filesystem::path path_;
  FileDescriptor file_;
  std::uint64_t bytes_ = 0;
};

/// A block whose header is intact.
struct SlogBlock {
  std::uint64_t offset = 0;  ///< of the header
  SlogBlockHeader header;
  std::uint64_t payload_offset() const noexcept { return offset + kSlogAlignment; }
  std::uint64_t end() const noexcept { return offset + slog_block_bytes(header); }
};

/// A damaged part of a file; bytes = 0: data are missing there.
struct LogDamage {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  std::string what;
};

struct SlogScan {
  std::vector<SlogBlock> blocks;  ///< in order of the file; sequence strictly increasing
  std::vector<LogDamage> damage;
  std::uint32_t log_id = 0;
};

enum class SlogScanDepth : std::uint8_t {
  headers,  ///< payloads are not read: less than a second for any log
  payloads  ///< every byte is read and checked
};

/// Finds the intact blocks of a file step by step. After damage, it continues at the next intact header of this log.
class SlogScanner {
 public:
  explicit SlogScanner(SlogScanDepth depth) : depth_(depth) {}

  /// The next blocks, at most `most` >= 4, whose order is judged among them.
  /// @throws FileError
  /// @throws FormatError if the file has no intact block, or one of an unknown version.
  SlogScan next(const SlogSource& source, std::size_t most);
  /// The damaged end of the file, where a writer may be at work: looked at again by the next step.
  const std::optional<LogDamage>& tail() const noexcept { return tail_; }
  bool is_at_end(const SlogSource& source) const noexcept {
    return tail_ || offset_ >= source.bytes();
  }

 private:
  SlogScanDepth depth_;
  std::uint64_t offset_ = 0;
  std::uint64_t sequence_ = 0;  // of the next block
  std::optional<std::uint32_t> log_id_;
  std::optional<LogDamage> tail_;
};

/// All blocks and all damage. @throws the same as SlogScanner
SlogScan scan_slog(const SlogSource& source, SlogScanDepth depth);

/// Whether nothing of a log that was begun is in its file: the process was killed, or had no power, before its first
/// block was on the disk. False for files of other programs. @throws FileError
bool is_unwritten_slog(const std::filesystem::path& file);

/// The payload of a block, checked. @throws FormatError naming the block.
std::vector<std::byte> read_payload(const SlogSource& source, const SlogBlock& block);
std::string read_text(const SlogSource& source, const SlogBlock& block);  ///< the same, of JSON

/// True if payload and padding match the CRC in the header. Reads in pieces.
bool payload_intact(const SlogSource& source, const SlogBlock& block);

/// "block 17 (samples, byte 81920)": the position of a block in messages.
std::string describe(const SlogBlock& block);

}  // namespace stageid
