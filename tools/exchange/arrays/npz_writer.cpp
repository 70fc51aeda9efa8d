#include <fmt/format.h>
#include <zlib.h>

#include <bit>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "acquisition/files/output_file.hpp"
#include "tools/exchange/arrays/npz_file.hpp"
#include "tools/terminal/unicode.hpp"

// Sources: NEP 1 (the .npy format, https://numpy.org/neps/nep-0001-npy-format.html) and PKWARE's APPNOTE.TXT 6.3 for
// the zip file; only stored members are written.

namespace stageid {
namespace {

static_assert(std::endian::native == std::endian::little, ".npy members are written as '<'");

constexpr std::size_t kMostBytes = 0xFFFF0000;  // larger files need the 64-bit form of zip

template <typename Number>
void put(std::string& bytes, Number value) {
  char raw[sizeof(Number)];
  std::memcpy(raw, &value, sizeof(Number));
  bytes.append(raw, sizeof(Number));
}

std::string shape_text(const std::vector<std::size_t>& shape) {
  std::string text;
  for (const std::size_t extent : shape) text += fmt::format("{}, ", extent);
  if (shape.size() > 1) text.resize(text.size() - 2);
  if (shape.size() == 1) text.resize(text.size() - 1);
  return "(" + text + ")";
}

/// Magic, version 1.0, length and a header that ends at a multiple of 64 bytes.
std::string npy(const std::string& type, const std::vector<std::size_t>& shape,
                std::string_view data) {
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': {}, }}", type,
                                   shape_text(shape));
  header.append(63 - (10 + header.size()) % 64, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  put(bytes, static_cast<std::uint16_t>(header.size()));
  return bytes.append(header).append(data);
}

std::string npy_of_texts(const std::vector<std::string>& texts,
                         const std::vector<std::size_t>& shape) {
  std::size_t longest = 1;
  std::vector<std::u32string> all;
  for (const std::string& text : texts) {
    all.push_back(code_points_of(text));
    longest = std::max(longest, all.back().size());
  }
  std::string data;
  for (std::u32string& points : all) {
    points.resize(longest, U'\0');
    data.append(reinterpret_cast<const char*>(points.data()), 4 * longest);
  }
  return npy(fmt::format("<U{}", longest), shape, data);
}

std::string npy_of(const NamedArray& array) {
  if (array.is_text()) return npy_of_texts(std::get<2>(array.values), array.shape);
  const std::size_t width = array.is_complex() ? 16 : 8;
  const void* data = array.is_complex()
                         ? static_cast<const void*>(std::get<1>(array.values).data())
                         : static_cast<const void*>(std::get<0>(array.values).data());
  const std::size_t bytes = array.size() * width;
  if (bytes >= kMostBytes)
    throw std::invalid_argument(
        fmt::format("'{}' has 4 GiB or more, too large for .npz files; write .h5", array.name));
  return npy(
      array.is_complex() ? "<c16" : "<f8", array.shape,
      bytes == 0 ? std::string_view() : std::string_view(static_cast<const char*>(data), bytes));
}

/// The common part of the local header and the directory: from the required version to the length of the name.
std::string member_head(const std::string& name, const std::string& content) {
  std::string head;
  put(head, std::uint16_t{20});
  put(head, std::uint16_t{0x0800});  // the name is UTF-8
  put(head, std::uint16_t{0});       // stored
  put(head, std::uint16_t{0});       // no time: 1980-01-01
  put(head, std::uint16_t{0x0021});
  put(head, static_cast<std::uint32_t>(
                crc32_z(0, reinterpret_cast<const Bytef*>(content.data()), content.size())));
  put(head, static_cast<std::uint32_t>(content.size()));
  put(head, static_cast<std::uint32_t>(content.size()));
  put(head, static_cast<std::uint16_t>(name.size()));
  put(head, std::uint16_t{0});  // no extra field
  return head;
}

std::string directory_entry(const std::string& name, const std::string& head, std::size_t offset) {
  std::string entry("PK\x01\x02\x14\x00", 6);
  entry += head;
  entry.append(10, '\0');  // no comment, first disk, no attributes
  put(entry, static_cast<std::uint32_t>(offset));
  return entry + name;
}

}  // namespace

void write_npz(const std::filesystem::path& path, const ArrayList& list) {
  std::string bytes, directory;
  for (const NamedArray& array : list.arrays) {
    const std::string name = array.name + ".npy";
    const std::string content = npy_of(array);
    const std::string head = member_head(name, content);
    directory += directory_entry(name, head, bytes.size());
    bytes.append("PK\x03\x04").append(head).append(name).append(content);
    if (bytes.size() >= kMostBytes)
      throw std::invalid_argument(fmt::format(
          "{}: would have 4 GiB or more, too large for an .npz file; write .h5", path.string()));
  }
  const std::size_t offset = bytes.size();
  bytes += directory;
  bytes.append("PK\x05\x06\0\0\0\0", 8);
  put(bytes, static_cast<std::uint16_t>(list.arrays.size()));
  put(bytes, static_cast<std::uint16_t>(list.arrays.size()));
  put(bytes, static_cast<std::uint32_t>(directory.size()));
  put(bytes, static_cast<std::uint32_t>(offset));
  put(bytes, std::uint16_t{0});
  write_text_file(path, bytes);
}

}  // namespace stageid
