#include <fmt/format.h>
#include <zip.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <system_error>

#include "acquisition/files/file_error.hpp"
#include "tools/exchange/arrays/npz_file.hpp"
#include "tools/terminal/output_paths.hpp"
#include "tools/terminal/unicode.hpp"

// Sources: as tools/exchange/arrays/npz_writer.cpp. Input is untrusted: every offset is checked.

namespace stageid {
namespace {

/// Limit of the compression ratio of a deflated stream.
constexpr std::size_t kMostInflation = 1032;

class Bytes {
 public:
  Bytes(const std::filesystem::path& file, std::string place, std::string_view data)
      : file_(file), place_(std::move(place)), data_(data) {}

  [[noreturn]] void fail(const std::string& what) const { throw FormatError(file_, place_, what); }
  std::string_view piece(std::size_t at, std::size_t size) const {
    if (at > data_.size() || size > data_.size() - at)
      fail("unexpected end of file; the file is truncated or damaged");
    return data_.substr(at, size);
  }
  template <typename Number>
  Number number(std::size_t at) const {
    Number value;
    std::memcpy(&value, piece(at, sizeof(Number)).data(), sizeof(Number));
    return value;
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
  if (at == std::string_view::npos) npy.fail(fmt::format("its header has no '{}'", key));
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

template <typename Number>
double element(const char* at, bool big_endian) {
  char raw[sizeof(Number)];
  std::memcpy(raw, at, sizeof(raw));
  if (big_endian) std::reverse(raw, raw + sizeof(raw));
  Number value;
  std::memcpy(&value, raw, sizeof(raw));
  return static_cast<double>(value);
}

using ElementReader = double (*)(const char*, bool);

/// Null if the type is unknown.
ElementReader reader_of(char kind, std::size_t width) {
  if (kind == 'f') return width == 8 ? element<double> : width == 4 ? element<float> : nullptr;
  if (kind == 'i')
    return width == 8   ? element<std::int64_t>
           : width == 4 ? element<std::int32_t>
           : width == 2 ? element<std::int16_t>
           : width == 1 ? element<std::int8_t>
                        : nullptr;
  if (kind == 'u' || kind == 'b')
    return width == 8   ? element<std::uint64_t>
           : width == 4 ? element<std::uint32_t>
           : width == 2 ? element<std::uint16_t>
           : width == 1 ? element<std::uint8_t>
                        : nullptr;
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
      points += static_cast<char32_t>(element<std::uint32_t>(at + 4 * c, layout.big_endian));
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
  if (layout.column_major) std::reverse(array.shape.begin(), array.shape.end());
  if (layout.kind == 'U' || layout.kind == 'S') {
    array.values = texts_of(npy, layout, data);
  } else {
    const bool complex = layout.kind == 'c';
    const std::size_t width = complex ? layout.width / 2 : layout.width;
    const ElementReader read = reader_of(complex ? 'f' : layout.kind, width);
    if (read == nullptr)
      npy.fail(fmt::format("unsupported number type '{}{}'; save float64, complex128 or integers",
                           layout.kind, layout.width));
    const std::size_t parts = complex ? 2 : 1;
    if (layout.count > data.size() / (parts * width)) npy.fail("its data are truncated");
    std::vector<double> numbers(parts * layout.count);
    for (std::size_t k = 0; k < numbers.size(); ++k)
      numbers[k] = read(data.data() + k * width, layout.big_endian);
    if (complex) {
      std::vector<std::complex<double>> values(layout.count);
      for (std::size_t k = 0; k < values.size(); ++k)
        values[k] = {numbers[2 * k], numbers[2 * k + 1]};
      array.values = std::move(values);
    } else {
      array.values = std::move(numbers);
    }
  }
  return layout.column_major ? reversed(array) : array;
}

}  // namespace

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
