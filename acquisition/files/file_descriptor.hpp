#pragma once

#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

namespace stageid {

/// An open file descriptor that closes itself. Errors of writing surface at fsync(), so close() is not checked.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int number) noexcept : number_(number) {}
  ~FileDescriptor() { reset(); }
  FileDescriptor(FileDescriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  int get() const noexcept { return number_; }
  explicit operator bool() const noexcept { return number_ >= 0; }
  void reset() noexcept {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
  }

 private:
  int number_ = -1;
};

/// Writes all of `text`. @returns false if the system fails, with its reason in errno
inline bool write_whole(const FileDescriptor& to, std::string_view text) noexcept {
  while (!text.empty()) {
    const ssize_t written = ::write(to.get(), text.data(), text.size());
    if (written < 0 && errno != EINTR) return false;
    if (written > 0) text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

/// Calls take(std::string_view) with everything up to the end, piece by piece.
/// @returns false if the system fails, with its reason in errno
template <typename Take>
bool read_pieces(const FileDescriptor& from, Take take) {
  std::string piece(std::size_t{1} << 18, '\0');
  while (true) {
    const ssize_t got = ::read(from.get(), piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return got == 0;
    take(std::string_view(piece.data(), static_cast<std::size_t>(got)));
  }
}

/// Appends everything up to the end. @returns false if the system fails, with its reason in errno
inline bool read_to_end(const FileDescriptor& from, std::string& text) {
  return read_pieces(from, [&](std::string_view piece) { text += piece; });
}

}  // namespace stageid
