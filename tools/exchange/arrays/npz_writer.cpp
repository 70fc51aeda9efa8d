#include <fmt/format.h>
#include <zip.h>

#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <new>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/output_file.hpp"
#include "tools/exchange/arrays/npz_file.hpp"
#include "tools/terminal/unicode.hpp"

// Source: NEP 1 (the .npy format, https://numpy.org/neps/nep-0001-npy-format.html).

namespace stageid {
namespace {

static_assert(std::endian::native == std::endian::little, ".npy members are written as '<'");

constexpr zip_uint16_t kFirstDay = 0x0021;  // 1980-01-01, the zip format's zero

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
  return npy(
      array.is_complex() ? "<c16" : "<f8", array.shape,
      bytes == 0 ? std::string_view() : std::string_view(static_cast<const char*>(data), bytes));
}

/// The bytes of the archive. libzip does not write the file itself: an interrupt would leave its temporary
/// file behind.
std::string archive_of(const std::filesystem::path& file, const ArrayList& list) {
  const std::unique_ptr<zip_source_t, decltype(&zip_source_free)> bytes(
      zip_source_buffer_create(nullptr, 0, 0, nullptr), &zip_source_free);
  std::unique_ptr<zip_t, decltype(&zip_discard)> archive(
      zip_open_from_source(bytes.get(), ZIP_CREATE | ZIP_TRUNCATE, nullptr), &zip_discard);
  if (archive == nullptr) throw std::bad_alloc();
  zip_source_keep(bytes.get());  // the archive frees it, too
  const auto require = [&](bool done) {
    if (!done)
      throw FileError(
          fmt::format("{}: cannot be written: {}", file.string(), zip_strerror(archive.get())));
  };

  std::vector<std::string> contents;  // zip_close() reads them
  for (const NamedArray& array : list.arrays) contents.push_back(npy_of(array));
  for (std::size_t k = 0; k < contents.size(); ++k) {
    zip_source_t* content =
        zip_source_buffer(archive.get(), contents[k].data(), contents[k].size(), 0);
    const zip_int64_t at = zip_file_add(archive.get(), (list.arrays[k].name + ".npy").c_str(),
                                        content, ZIP_FL_ENC_UTF_8);
    if (at < 0) zip_source_free(content);
    require(at >= 0);
    const auto index = static_cast<zip_uint64_t>(at);
    require(zip_set_file_compression(archive.get(), index, ZIP_CM_STORE, 0) == 0);
    require(zip_file_set_dostime(archive.get(), index, 0, kFirstDay, 0) == 0);
  }
  require(zip_close(archive.get()) == 0);
  static_cast<void>(archive.release());

  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_source_stat(bytes.get(), &stat) != 0 || zip_source_open(bytes.get()) != 0)
    throw std::bad_alloc();
  std::string out(stat.size, '\0');
  zip_source_read(bytes.get(), out.data(), out.size());
  zip_source_close(bytes.get());
  return out;
}

}  // namespace

void write_npz(const std::filesystem::path& path, const ArrayList& list) {
  write_text_file(path, archive_of(path, list));
}

}  // namespace stageid
