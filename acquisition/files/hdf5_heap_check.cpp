#include <algorithm>
#include <cstdint>
#include <fstream>
#include <ios>
#include <string>
#include <string_view>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/hdf5_support.hpp"

namespace stageid::hdf5 {
namespace {

// Layout: HDF5 File Format Specification 3.0, section III.E "Disk Format: Level 1E - Global Heap".
// Collection: "GCOL", version 1, 3 bytes 0, size (8); objects: index (2), references (2), 4 bytes 0,
// size (8), data padded to 8 bytes. Index 0 is the free space; its size includes its own header.
constexpr std::string_view kStart("GCOL\1\0\0\0", 8);
constexpr std::size_t kHeader = 16;
constexpr std::size_t kAlignment = 8;

std::uint64_t little_endian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = bytes.size(); i > 0; --i)
    value = value << 8U | static_cast<unsigned char>(bytes[i - 1]);
  return value;
}

/// True if the objects fill the collection; `heap` contains all of it.
bool objects_fit(std::string_view heap) {
  std::size_t at = kHeader;
  while (heap.size() - at >= kHeader) {
    const std::uint64_t index = little_endian(heap.substr(at, 2));
    const std::uint64_t size = little_endian(heap.substr(at + 8, 8));
    const std::size_t left = heap.size() - at;
    if (index == 0) return size == left;
    if (size > left - kHeader) return false;
    const auto data = static_cast<std::size_t>(size);
    at += std::min(left, kHeader + (data + kAlignment - 1) / kAlignment * kAlignment);
  }
  return true;
}

/// Checks the heaps that begin in `window`, which starts at `offset` of the file.
void check_window(const std::filesystem::path& file, std::string_view window, std::uint64_t offset,
                  std::uint64_t file_bytes) {
  for (std::size_t at = window.find(kStart); at != std::string_view::npos;
       at = window.find(kStart, at + 1)) {
    if (window.size() - at < kHeader) return;
    const std::uint64_t size = little_endian(window.substr(at + 8, 8));
    const bool whole = size <= window.size() - at;
    const bool fits = size >= kHeader && size <= file_bytes - offset - at;
    if (!fits || (whole && !objects_fit(window.substr(at, size))))
      fail_format(file, "",
                  "the HDF5 file is damaged: the strings stored at byte {} overlap; copy it again "
                  "or recreate it",
                  offset + at);
  }
}

}  // namespace

void check_global_heaps(const std::filesystem::path& file) {
  constexpr std::uint64_t kWindow = std::uint64_t{4} << 20;
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  const std::streamoff end = stream.tellg();
  if (!stream || end < 0) fail_file(file, "cannot be read");
  const auto file_bytes = static_cast<std::uint64_t>(end);
  std::string window;
  const auto check_from = [&](std::uint64_t offset, std::uint64_t bytes) {
    window.resize(bytes);
    stream.seekg(static_cast<std::streamoff>(offset));
    stream.read(window.data(), static_cast<std::streamsize>(bytes));
    if (!stream) fail_file(file, "cannot be read");
    check_window(file, window, offset, file_bytes);
  };
  if (file_bytes <= 2 * kWindow) {
    check_from(0, file_bytes);
  } else {
    check_from(0, kWindow);
    check_from(file_bytes - kWindow, kWindow);
  }
}

}  // namespace stageid::hdf5
