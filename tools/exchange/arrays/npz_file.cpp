#include "tools/exchange/arrays/npz_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <zip.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <memory>
#include <new>
#include <system_error>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/output_file.hpp"
#include "tools/exchange/arrays/raw_number.hpp"
#include "tools/terminal/output_paths.hpp"
#include "tools/terminal/unicode.hpp"

// Source: NEP 1 (the .npy format, https://numpy.org/neps/nep-0001-npy-format.html).

namespace stageid {
namespace {

// Writing -----------------------------------------------------------------------------------------

static_assert(std::endian::native == std::endian::little, ".npy members are written as '<'");

constexpr zip_uint16_t kFirstDay = 0x0021;  // 1980-01-01, the zip format's zero

/// Magic, version 1.0, length and a header that ends at a multiple of 64 bytes.
std::string npy(const std::string& type, const std::vector<std::size_t>& shape,
                std::string_view data) {
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}{}), }}",
                                   type, fmt::join(shape, ", "), shape.size() == 1 ? "," : "");
  header.append(63 - (10 + header.size()) % 64, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  append_raw(bytes, static_cast<std::uint16_t>(header.size()));
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
  const auto bytes = [](const auto& values) {
    return std::string_view(reinterpret_cast<const char*>(values.data()),
                            values.size() * sizeof(values[0]));
  };
  if (array.is_complex()) return npy("<c16", array.shape, bytes(std::get<1>(array.values)));
  return npy("<f8", array.shape, bytes(std::get<0>(array.values)));
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
    if (!done) fail_file(file, "cannot be written: {}", zip_strerror(archive.get()));
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

// Reading: the input is untrusted, so every offset is checked ------------------------------------

/// Limit of the compression ratio of a deflated stream.
constexpr std::size_t kMostInflation = 1032;

class Bytes {
 public:
  Bytes(const std::filesystem::path& file, std::string place, std::string_view data)
      : file_(file), place_(std::move(place)), data_(data) {}

  template <typename... Parts>
  [[noreturn]] void fail(fmt::format_string<Parts...> what, Parts&&... parts) const {
    fail_format(file_, place_, what, std::forward<Parts>(parts)...);
  }
  std::string_view piece(std::size_t at, std::size_t size) const {
    if (at > data_.size() || size > data_.size() - at)
      fail("unexpected end of file; the file is truncated or damaged");
    return data_.substr(at, size);
  }
  template <typename Number>
  Number number(std::size_t at) const {
    return raw_number<Number>(piece(at, sizeof(Number)).data());
  }
  std::size_t size() const noexcept { return data_.size(); }

 private:
  const std::filesystem::path& file_;
  std::string place_;
  std::string_view data_;
};

/// The members of a file. Sizes in its directory are checked before memory is allocated for them.
class NpzArchive {
 public:
  explicit NpzArchive(const std::filesystem::path& file)
      : file_(file), archive_(zip_open(file.c_str(), ZIP_RDONLY, nullptr), &zip_discard) {
    std::error_code error;
    bytes_ = std::filesystem::file_size(file, error);
    if (archive_ == nullptr || error || bytes_ == 0)  // libzip accepts an empty file as an archive
      throw FormatError(file, "",
                        "is not an .npz file, or is truncated; write it with numpy.savez()");
  }

  zip_uint64_t members() const {
    return static_cast<zip_uint64_t>(zip_get_num_entries(archive_.get(), 0));
  }
  std::string name(zip_uint64_t index) const { return member(index).name; }

  /// @throws FormatError naming the member
  std::string content(zip_uint64_t index) {
    const zip_stat_t stat = member(index);
    const auto fail = [&](const char* what) { throw FormatError(file_, stat.name, what); };
    if (stat.encryption_method != ZIP_EM_NONE) fail("is encrypted; save it without a password");
    const bool stored = stat.comp_method == ZIP_CM_STORE;
    if (!stored && stat.comp_method != ZIP_CM_DEFLATE)
      fail("unsupported compression method; use numpy.savez()");
    if (stat.comp_size > bytes_) fail("unexpected end of file; the file is truncated or damaged");
    taken_ += stat.comp_size;
    if (taken_ > bytes_) fail("shares its bytes with another member; the file is damaged");
    if (stat.size > (stored ? stat.comp_size : kMostInflation * (stat.comp_size + 1)))
      fail("its size is damaged");
    const std::unique_ptr<zip_file_t, decltype(&zip_fclose)> opened(
        zip_fopen_index(archive_.get(), index, 0), &zip_fclose);
    if (opened == nullptr) fail("cannot be read; the file is truncated or damaged");
    std::string content(stat.size, '\0');
    const zip_int64_t got = zip_fread(opened.get(), content.data(), content.size());
    // libzip compares the checksum when it reaches the end.
    char beyond = 0;
    const zip_int64_t more = zip_fread(opened.get(), &beyond, 1);
    if (zip_error_code_zip(zip_file_get_error(opened.get())) == ZIP_ER_CRC)
      fail("its checksum (CRC-32) does not match; the file is damaged. Copy or save it again");
    if (more != 0 || got != static_cast<zip_int64_t>(content.size()))
      fail("cannot be decompressed; the file is damaged");
    return content;
  }

 private:
  zip_stat_t member(zip_uint64_t index) const {
    zip_stat_t stat;
    zip_stat_init(&stat);
    if (zip_stat_index(archive_.get(), index, 0, &stat) != 0)
      throw FormatError(file_, "", "its directory is damaged");
    return stat;
  }

  const std::filesystem::path& file_;
  zip_uint64_t bytes_ = 0;
  zip_uint64_t taken_ = 0;  ///< by the members read
  std::unique_ptr<zip_t, decltype(&zip_discard)> archive_;
};

/// Header of a .npy member.
struct Layout {
  char kind = 'f';
  std::size_t width = 8;  ///< bytes per element; for U: characters
  bool big_endian = false;
  bool column_major = false;
  std::vector<std::size_t> shape;
  std::size_t count = 1;
};

std::string_view value_of(const Bytes& npy, std::string_view header, std::string_view key) {
  const std::size_t at = header.find(fmt::format("'{}':", key));
  if (at == std::string_view::npos) npy.fail("its header has no '{}'", key);
  std::string_view value = header.substr(at + key.size() + 3);
  value.remove_prefix(std::min(value.find_first_not_of(' '), value.size()));
  return value;
}

std::size_t whole_number(const Bytes& npy, std::string_view digits) {
  std::size_t value = 0;
  for (const char c : digits) {
    if (c < '0' || c > '9' || value > (std::size_t{1} << 48)) npy.fail("its header is damaged");
    value = 10 * value + static_cast<std::size_t>(c - '0');
  }
  return value;
}

void read_shape(const Bytes& npy, std::string_view text, Layout& layout) {
  const std::size_t close = text.find(')');
  if (!text.starts_with('(') || close == std::string_view::npos) npy.fail("its shape is damaged");
  text = text.substr(1, close - 1);
  while (!text.empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    std::string_view digits = text.substr(0, comma);
    digits.remove_prefix(std::min(digits.find_first_not_of(' '), digits.size()));
    if (!digits.empty()) layout.shape.push_back(whole_number(npy, digits));
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  for (const std::size_t extent : layout.shape) {
    layout.count *= extent;
    if (layout.count > npy.size())
      npy.fail("its shape is larger than the data; the file is damaged");
  }
}

Layout layout_of(const Bytes& npy, std::string_view header) {
  Layout layout;
  const std::string_view type = value_of(npy, header, "descr");
  const std::size_t quote = type.size() < 2 ? std::string_view::npos : type.find('\'', 1);
  if (type.starts_with("'|O")) npy.fail("contains Python objects; save arrays of numbers or text");
  if (!type.starts_with('\'') || quote == std::string_view::npos || quote < 4)
    npy.fail("contains records; save one array of numbers per name");
  layout.big_endian = type[1] == '>';
  layout.kind = type[2];
  layout.width = whole_number(npy, type.substr(3, quote - 3));
  layout.column_major = value_of(npy, header, "fortran_order").starts_with("True");
  read_shape(npy, value_of(npy, header, "shape"), layout);
  return layout;
}

constexpr std::pair<char, NumberType> kNumberTypes[] = {
    {'f', kNumberType<double>},        {'f', kNumberType<float>},
    {'i', kNumberType<std::int64_t>},  {'i', kNumberType<std::int32_t>},
    {'i', kNumberType<std::int16_t>},  {'i', kNumberType<std::int8_t>},
    {'u', kNumberType<std::uint64_t>}, {'u', kNumberType<std::uint32_t>},
    {'u', kNumberType<std::uint16_t>}, {'u', kNumberType<std::uint8_t>}};

/// @param width in bytes   @returns null if the type is unknown
const NumberType* number_type(char kind, std::size_t width) {
  for (const auto& [known, type] : kNumberTypes)
    if (known == kind && type.width == width) return &type;
  return nullptr;
}

std::vector<std::string> texts_of(const Bytes& npy, const Layout& layout, std::string_view data) {
  std::vector<std::string> texts;
  const std::size_t step = layout.kind == 'U' ? 4 * layout.width : layout.width;
  if (step != 0 && layout.count > data.size() / step) npy.fail("its data are truncated");
  for (std::size_t k = 0; k < layout.count; ++k) {
    const char* at = data.data() + k * step;
    if (layout.kind == 'S') {
      texts.emplace_back(at, strnlen(at, step));
      continue;
    }
    std::u32string points;
    for (std::size_t c = 0; c < layout.width; ++c)
      points += raw_number<char32_t>(at + 4 * c, layout.big_endian);
    texts.push_back(utf8_of(points.substr(0, points.find(U'\0'))));
  }
  return texts;
}

NamedArray array_of(const std::filesystem::path& file, std::string name, std::string_view content) {
  const Bytes npy(file, name, content);
  if (npy.piece(0, 6) != std::string_view("\x93NUMPY", 6)) npy.fail("is not an .npy array");
  const bool short_header = npy.number<std::uint8_t>(6) == 1;
  const std::size_t start = short_header ? 10 : 12;
  const std::size_t header_bytes =
      short_header ? npy.number<std::uint16_t>(8) : npy.number<std::uint32_t>(8);
  const Layout layout = layout_of(npy, npy.piece(start, header_bytes));
  const std::string_view data = content.substr(start + header_bytes);
  NamedArray array{std::move(name), layout.shape, {}};
  if (layout.column_major) std::ranges::reverse(array.shape);
  if (layout.kind == 'U' || layout.kind == 'S') {
    array.values = texts_of(npy, layout, data);
  } else {
    const std::size_t parts = layout.kind == 'c' ? 2 : 1;
    const char kind = layout.kind == 'c' ? 'f' : layout.kind == 'b' ? 'u' : layout.kind;
    const NumberType* type = number_type(kind, layout.width / parts);
    if (type == nullptr)
      npy.fail("unsupported number type '{}{}'; save float64, complex128 or integers", layout.kind,
               layout.width);
    if (layout.count > data.size() / (parts * type->width)) npy.fail("its data are truncated");
    const auto read = [&](double* to) {
      for (std::size_t k = 0; k < parts * layout.count; ++k)
        to[k] = type->read(data.data() + k * type->width, layout.big_endian);
    };
    if (parts == 2)
      read(reinterpret_cast<double*>(
          array.values.emplace<1>(layout.count).data()));  // real and imaginary parts in turn
    else
      read(array.values.emplace<0>(layout.count).data());
  }
  return layout.column_major ? reversed(array) : array;
}

}  // namespace

void write_npz(const std::filesystem::path& path, const ArrayList& list) {
  write_text_file(path, archive_of(path, list));
}

ArrayList read_npz(const std::filesystem::path& file) {
  require_readable(file);
  NpzArchive archive(file);
  ArrayList list{file, {}};
  for (zip_uint64_t i = 0; i < archive.members(); ++i) {
    std::string name = archive.name(i);
    const std::string content = archive.content(i);
    if (name.ends_with(".npy")) name.resize(name.size() - 4);
    list.arrays.push_back(array_of(file, name, content));
  }
  return list;
}

}  // namespace stageid
