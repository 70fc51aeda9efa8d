#include "acquisition/slog/slog_appender.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <random>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/files/system_reason.hpp"
#include "acquisition/slog/crc32c.hpp"

namespace stageid {

namespace {

constexpr std::array<std::byte, kSlogAlignment> kZeros{};

void lock(const FileDescriptor& file, const std::filesystem::path& path) {
  if (::flock(file.get(), LOCK_EX | LOCK_NB) == 0) return;
  fail_file(path, "another process is writing this log; wait until it has ended");
}

/// Makes the directory entry of a new file durable. Failures are ignored: some file systems cannot.
void synchronize_directory(const std::filesystem::path& file) {
  const std::filesystem::path parent = file.has_parent_path() ? file.parent_path() : ".";
  const FileDescriptor directory(::open(parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (directory) static_cast<void>(::fsync(directory.get()));
}

std::int64_t now_ns() {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
}

}  // namespace

SlogAppender::SlogAppender(std::filesystem::path path, FileDescriptor file, std::uint32_t log_id)
    : path_(std::move(path)), file_(std::move(file)), log_id_(log_id) {}

SlogAppender SlogAppender::create(const std::filesystem::path& file) {
  FileDescriptor descriptor(
      ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644));
  if (!descriptor) {
    const int error = errno;
    throw FileError(
        error == EEXIST
            ? fmt::format("{}: already exists; give another name, or continue it with --resume",
                          file.string())
            : fmt::format("{}: cannot be created: {}", shown_name(file).string(),
                          system_reason(error)));
  }
  lock(descriptor, file);
  synchronize_directory(file);
  return {file, std::move(descriptor), std::random_device{}()};
}

SlogAppender SlogAppender::open_existing(const std::filesystem::path& file) {
  FileDescriptor descriptor(::open(file.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC));
  if (!descriptor) fail_file(file, "cannot be opened for writing: {}", system_reason(errno));
  lock(descriptor, file);
  return {file, std::move(descriptor), 0};
}

void SlogAppender::continue_at(std::uint64_t bytes, std::uint32_t log_id,
                               std::uint64_t next_sequence) {
  if (::ftruncate(file_.get(), static_cast<off_t>(bytes)) != 0)
    fail_file(path_, "cannot be truncated to its intact {} bytes: {}", bytes, system_reason(errno));
  bytes_ = written_back_ = bytes;
  log_id_ = log_id;
  next_sequence_ = next_sequence;
}

void SlogAppender::append(SlogBlockHeader header, std::span<const std::byte> payload) {
  if (payload.size() > kSlogLargestPayload)
    fail_request("{}: a {} block of {} bytes exceeds the maximum of {} bytes", path_.string(),
                 to_string(static_cast<SlogBlockType>(header.type)), payload.size(),
                 kSlogLargestPayload);
  const std::size_t padding = slog_padded(payload.size()) - payload.size();
  header.log_id = log_id_;
  header.sequence = next_sequence_;
  header.payload_bytes = static_cast<std::uint32_t>(payload.size());
  header.payload_crc = crc32c(std::span(kZeros).first(padding), crc32c(payload));
  if (header.time_ns == 0) header.time_ns = now_ns();
  header.header_crc = slog_header_crc(header);
  write_block(header, payload, padding);
  bytes_ += slog_block_bytes(header);
  ++next_sequence_;
  start_writeback();
}

// Starts writing in the background, so that synchronize() has little left to wait for.
void SlogAppender::start_writeback() noexcept {
  constexpr std::uint64_t kEvery = std::uint64_t{8} << 20;
  if (bytes_ - written_back_ < kEvery) return;
  static_cast<void>(::sync_file_range(file_.get(), static_cast<off64_t>(written_back_),
                                      static_cast<off64_t>(bytes_ - written_back_),
                                      SYNC_FILE_RANGE_WRITE));
  written_back_ = bytes_;
}

void SlogAppender::append(const SlogBlockHeader& header, std::string_view json) {
  append(header, std::as_bytes(std::span(json)));
}

void SlogAppender::write_block(const SlogBlockHeader& header, std::span<const std::byte> payload,
                               std::size_t padding) {
  if (error_ != 0 || !is_open()) fail(error_ != 0 ? error_ : EBADF);
  const auto part = [](const void* data, std::size_t size) {
    return iovec{const_cast<void*>(data), size};  // writev only reads
  };
  std::array<iovec, 3> parts = {part(&header, sizeof header), part(payload.data(), payload.size()),
                                part(kZeros.data(), padding)};
  for (std::size_t first = 0; first < parts.size();) {
    const ssize_t count =
        ::writev(file_.get(), parts.data() + first, static_cast<int>(parts.size() - first));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) fail(count < 0 ? errno : ENOSPC);
    auto written = static_cast<std::size_t>(count);
    while (first < parts.size() && written >= parts[first].iov_len)
      written -= parts[first++].iov_len;
    if (written > 0) {
      parts[first].iov_base = static_cast<std::byte*>(parts[first].iov_base) + written;
      parts[first].iov_len -= written;
    }
  }
}

void SlogAppender::fail(int error) {
  error_ = error;
  // Readers would take a partial block for damage.
  const bool cut = is_open() && ::ftruncate(file_.get(), static_cast<off_t>(bytes_)) == 0;
  fail_file(shown_name(path_), "cannot be written: {}; {} ({} bytes) written earlier {} kept{}",
            system_reason(error), counted(next_sequence_, "block"), bytes_,
            next_sequence_ == 1 ? "is" : "are",
            cut ? "" : ", possibly followed by part of another block");
}

// Rows written to a removed file would be lost.
void SlogAppender::require_name() {
  struct stat status {};
  if (::fstat(file_.get(), &status) != 0 || status.st_nlink > 0) return;
  error_ = ENOENT;
  fail_file(path_,
            "the file or its directory was removed during the run; the data are lost. Measure "
            "again, and keep the directory until the run has ended");
}

void SlogAppender::synchronize() {
  require_name();
  if (::fdatasync(file_.get()) == 0 || errno == EINVAL || errno == EROFS) return;
  const int error = errno;
  error_ = error;
  fail_file(path_, "cannot be flushed to disk: {}; data written since the last flush may be lost",
            system_reason(error));
}

void SlogAppender::close() {
  if (!is_open()) return;
  synchronize();
  file_.reset();
}

}  // namespace stageid
