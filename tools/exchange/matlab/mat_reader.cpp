#include <fmt/format.h>
#include <matio.h>
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <memory>
#include <new>
#include <optional>
#include <string_view>
#include <utility>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/hdf5_library.hpp"
#include "acquisition/files/input_files.hpp"
#include "tools/exchange/arrays/raw_number.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/terminal/output_paths.hpp"
#include "tools/terminal/unicode.hpp"

namespace stageid {
namespace {

using MatFile = std::unique_ptr<mat_t, int (*)(mat_t*)>;
using Variable = std::unique_ptr<matvar_t, void (*)(matvar_t*)>;

/// Text in front of the variables of a version 5 file.
constexpr std::size_t kHeadBytes = 128;
/// Structures, cells and objects nested deeper are not followed.
constexpr int kDeepest = 20;

/// 1 GiB of real numbers: the limit for a full matrix from a sparse one.
constexpr std::size_t kMostFullNumbers = std::size_t{1} << 27;

// Objects, which libmatio does not report by name --------------------------------------------------

/// Description of a MATLAB object (table, timetable, datetime, string, ...) of this class; "" if unknown.
UnreadVariable unread_object(const std::string& name, const std::string& object_class) {
  return {
      name, fmt::format("MATLAB object{}", object_class.empty() ? "" : " (" + object_class + ")"),
      fmt::format("Save its contents as arrays in MATLAB, for example x = {0}.COLUMN of a table, "
                  "or struct({0})",
                  name.empty() ? "T" : name)};
}

constexpr std::uint32_t kMatrix = 14, kCompressed = 15;
constexpr std::uint32_t kOpaqueClass = 17;

std::uint32_t word_at(std::string_view bytes, std::size_t at, bool big_endian) {
  return raw_number<std::uint32_t>(bytes.data() + at, big_endian);
}

/// The elements of a variable, up to the first incomplete one.
class Elements {
 public:
  Elements(std::string_view bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  std::optional<std::string_view> next() {
    if (at_ + 8 > bytes_.size()) return std::nullopt;
    const std::uint32_t type = word_at(bytes_, at_, big_endian_);
    // Up to four bytes of data are in the tag itself, their number in its upper half.
    const std::size_t small = type >> 16U;
    const std::size_t size = small > 0 ? small : word_at(bytes_, at_ + 4, big_endian_);
    const std::size_t start = at_ + (small > 0 ? 4 : 8);
    if (small > 4 || size > bytes_.size() - start) return std::nullopt;
    at_ = small > 0 ? at_ + 8 : start + (size + 7) / 8 * 8;
    return bytes_.substr(start, size);
  }

 private:
  std::string_view bytes_;
  bool big_endian_;
  std::size_t at_ = 0;
};

/// The first bytes of a deflated variable, which contain names and classes.
std::string inflated_begin(std::string_view deflated) {
  std::string begin(1024, '\0');
  uLongf size = begin.size();
  // If the output is full or the input damaged, it has inflated what it could.
  if (uncompress(reinterpret_cast<Bytef*>(begin.data()), &size,
                 reinterpret_cast<const Bytef*>(deflated.data()), deflated.size()) == Z_MEM_ERROR)
    throw std::bad_alloc();
  begin.resize(size);
  return begin;
}

std::optional<UnreadVariable> object_of(std::string_view variable, bool big_endian) {
  if (variable.size() < 8 || word_at(variable, 0, big_endian) != kMatrix) return std::nullopt;
  Elements elements(variable.substr(8), big_endian);
  const auto flags = elements.next();
  if (!flags || flags->size() < 4 || (word_at(*flags, 0, big_endian) & 0xffU) != kOpaqueClass)
    return std::nullopt;
  const auto name = elements.next();
  elements.next();  // the object system: MCOS or java
  const auto object_class = elements.next();
  if (!name || !object_class) return std::nullopt;
  return unread_object(std::string(*name), std::string(*object_class));
}

bool is_read(const ArrayList& list, const std::string& name) {
  const auto matches = [&](const auto& item) {
    return item.name == name || (item.name.size() > name.size() && item.name.starts_with(name) &&
                                 item.name[name.size()] == '/');
  };
  return std::ranges::any_of(list.arrays, matches) || std::ranges::any_of(list.unread, matches);
}

/// Compares the arrays read from a version 7.3 file with its content; objects and function handles are added to
/// `list.unread`.
/// @throws FormatError naming a variable or a field that is in the file and could not be read
void require_all_of(const Hdf5File& file, const std::string& group, int depth, ArrayList& list) {
  if (depth > kDeepest) return;
  for (const std::string& child : file.children(group)) {
    if (child.starts_with('#')) continue;  // targets of references, and the data of objects
    const std::string object = fmt::format("{}/{}", group == "/" ? "" : group, child);
    const std::string name = object.substr(1);
    const std::string kind = file.has_attribute(object, "MATLAB_class")
                                 ? file.read_text_attribute(object, "MATLAB_class")
                                 : "";
    if (kind == "function_handle") {
      list.unread.push_back({name, "function handle", "Save its values as an array"});
    } else if (file.has_attribute(object, "MATLAB_object_decode") && !is_read(list, name)) {
      list.unread.push_back(unread_object(name, kind));
    } else if (file.is_group(object) && !file.has_attribute(object, "MATLAB_sparse")) {
      require_all_of(file, object, depth + 1, list);
    } else if (!is_read(list, name) && !file.has_attribute(object, "MATLAB_empty") &&
               !(depth > 0 && is_read(list, group.substr(1) + "/0/" + child))) {
      list.fail(name,
                "its data cannot be read; the file is damaged. Save it again in MATLAB, "
                "for example with -v7");
    }
  }
}

/// The objects among the variables of a version 5 file.
/// Source: MAT-File Format (MathWorks), array class 17 (opaque): flags, name, "MCOS", class.
/// @throws FormatError if its last element does not end at the end of the file: libmatio does not detect truncation
std::vector<UnreadVariable> objects_of_v5(const std::filesystem::path& path) {
  const std::string content = read_whole_file(path);
  std::vector<UnreadVariable> objects;
  if (!content.starts_with("MATLAB 5.0") || content.size() < kHeadBytes) return objects;
  const bool big_endian = content[126] == 'M';
  std::size_t at = kHeadBytes;
  while (at + 8 <= content.size()) {
    const std::uint32_t type = word_at(content, at, big_endian);
    const std::size_t size = word_at(content, at + 4, big_endian);
    const std::string_view element =
        std::string_view(content).substr(at, 8 + std::min(size, content.size() - at - 8));
    const auto object = type == kCompressed
                            ? object_of(inflated_begin(element.substr(8)), big_endian)
                            : object_of(element, big_endian);
    if (object) objects.push_back(*object);
    at += 8 + size;
  }
  if (at != content.size())
    throw FormatError(path, "", "unexpected end of file; the file is truncated or damaged");
  return objects;
}

// Variables ---------------------------------------------------------------------------------------

constexpr std::pair<matio_types, NumberType> kNumberTypes[] = {
    {MAT_T_DOUBLE, kNumberType<double>},       {MAT_T_SINGLE, kNumberType<float>},
    {MAT_T_INT64, kNumberType<std::int64_t>},  {MAT_T_UINT64, kNumberType<std::uint64_t>},
    {MAT_T_INT32, kNumberType<std::int32_t>},  {MAT_T_UINT32, kNumberType<std::uint32_t>},
    {MAT_T_INT16, kNumberType<std::int16_t>},  {MAT_T_UINT16, kNumberType<std::uint16_t>},
    {MAT_T_UTF16, kNumberType<std::uint16_t>}, {MAT_T_INT8, kNumberType<std::int8_t>},
    {MAT_T_UINT8, kNumberType<std::uint8_t>},  {MAT_T_UTF8, kNumberType<std::uint8_t>}};

/// False if the type is not numeric.
bool read_numbers(matio_types type, const void* data, std::size_t count, std::vector<double>& out) {
  for (const auto& [known, number] : kNumberTypes) {
    if (known != type) continue;
    out.reserve(count);
    for (std::size_t k = 0; k < count; ++k)
      out.push_back(number.read(static_cast<const char*>(data) + k * number.width, false));
    return true;
  }
  return false;
}

/// Real or complex numbers at `data`; empty if the type is not numeric.
std::optional<NamedArray::Values> numbers_of(const matvar_t& variable, const void* data,
                                             std::size_t count) {
  std::vector<double> real, imaginary;
  if (variable.isComplex == 0) {
    if (!read_numbers(variable.data_type, data, count, real)) return std::nullopt;
    return real;
  }
  const auto* parts = static_cast<const mat_complex_split_t*>(data);
  if (count > 0 && (!read_numbers(variable.data_type, parts->Re, count, real) ||
                    !read_numbers(variable.data_type, parts->Im, count, imaginary)))
    return std::nullopt;
  std::vector<std::complex<double>> values(count);
  for (std::size_t k = 0; k < count; ++k) values[k] = {real[k], imaginary[k]};
  return values;
}

class Reader {
 public:
  explicit Reader(ArrayList& list) : list_(list) {}

  void read(const matvar_t& variable, const std::string& name, int depth) {
    if (depth > kDeepest) return;
    switch (variable.class_type) {
      case MAT_C_STRUCT:
        return read_struct(variable, name, depth);
      case MAT_C_CELL:
        return read_cell(variable, name, depth);
      case MAT_C_CHAR:
        list_.arrays.push_back({name, {}, std::vector<std::string>{text_of(variable)}});
        return;
      case MAT_C_SPARSE:
        return read_sparse(variable, name);
      case MAT_C_OBJECT:
      case MAT_C_OPAQUE:
        return;  // named by objects_of_v5() and require_all_of()
      case MAT_C_FUNCTION:
        list_.unread.push_back({name, "function handle", "Save its values as an array"});
        return;
      case MAT_C_EMPTY:
        return;
      default:
        return read_array(variable, name);
    }
  }

 private:
  static std::size_t count_of(const matvar_t& variable) {
    std::size_t count = 1;
    for (int q = 0; q < variable.rank; ++q) count *= variable.dims[q];
    return count;
  }

  [[noreturn]] void damaged(const std::string& name) const {
    list_.fail(name, "its data cannot be read; the file is damaged");
  }

  std::string text_of(const matvar_t& variable) const {
    const std::size_t count = count_of(variable);
    if (count == 0) return {};
    if (variable.data == nullptr) damaged(variable.name == nullptr ? "" : variable.name);
    if (variable.data_type == MAT_T_UTF8)
      return {static_cast<const char*>(variable.data), std::min(count, variable.nbytes)};
    std::vector<double> codes;
    read_numbers(variable.data_type, variable.data, count, codes);
    std::u16string units;
    for (const double code : codes) units += static_cast<char16_t>(code);
    return utf8_of(units);
  }

  void read_struct(const matvar_t& variable, const std::string& name, int depth) {
    const std::size_t count = count_of(variable);
    // libmatio only reads it; its interface merely lacks const.
    auto* structs = const_cast<matvar_t*>(&variable);
    const unsigned fields = Mat_VarGetNumberOfFields(structs);
    char* const* names = Mat_VarGetStructFieldnames(structs);
    for (std::size_t k = 0; k < count; ++k)
      for (unsigned f = 0; f < fields; ++f)
        if (const matvar_t* field = Mat_VarGetStructFieldByIndex(structs, f, k))
          read(*field,
               count == 1 ? fmt::format("{}/{}", name, names[f])
                          : fmt::format("{}/{}/{}", name, k, names[f]),
               depth + 1);
  }

  void read_cell(const matvar_t& variable, const std::string& name, int depth) {
    const std::size_t count = count_of(variable);
    auto* const* cells = static_cast<matvar_t* const*>(variable.data);
    if (count > 0 && cells == nullptr) damaged(name);
    std::vector<std::string> texts;
    for (std::size_t k = 0; k < count; ++k)
      if (cells[k] != nullptr && cells[k]->class_type == MAT_C_CHAR)
        texts.push_back(text_of(*cells[k]));
    if (texts.size() == count && count > 0) {
      list_.arrays.push_back({name, {count}, std::move(texts)});
      return;
    }
    for (std::size_t k = 0; k < count; ++k)
      if (cells[k] != nullptr) read(*cells[k], fmt::format("{}/{}", name, k), depth + 1);
  }

  void read_array(const matvar_t& variable, const std::string& name) {
    const std::size_t count = count_of(variable);
    if (count > 0 && variable.data == nullptr) damaged(name);
    // Column-major: the shape reversed in C order.
    const std::vector<std::size_t> shape(variable.dims, variable.dims + variable.rank);
    if (auto values = numbers_of(variable, variable.data, count))
      list_.arrays.push_back(reversed({name, {shape.rbegin(), shape.rend()}, std::move(*values)}));
  }

  /// As a full matrix, because channels and samples are full.
  void read_sparse(const matvar_t& variable, const std::string& name) {
    const auto* sparse = static_cast<const mat_sparse_t*>(variable.data);
    const std::size_t rows = variable.dims[0];
    const std::size_t columns = variable.dims[1];
    if (sparse == nullptr || sparse->jc == nullptr || sparse->njc != columns + 1) damaged(name);
    if (columns > 0 && rows > kMostFullNumbers / columns)
      list_.fail(name,
                 "is a sparse matrix of {} x {}, too large for a full one. Save "
                 "the needed part with full()",
                 rows, columns);
    const std::size_t count = sparse->ndata;
    if (count > 0 && sparse->data == nullptr) damaged(name);
    const auto nonzero = numbers_of(variable, sparse->data, count);
    if (count > 0 && !nonzero) damaged(name);
    NamedArray out{name, {rows, columns}, nonzero.value_or(NamedArray::Values())};
    const auto place = [&](auto& values) {
      const auto given = std::exchange(values, std::decay_t<decltype(values)>(rows * columns));
      for (std::size_t c = 0; c < columns; ++c)
        for (std::size_t k = sparse->jc[c]; k < sparse->jc[c + 1]; ++k) {
          if (k >= count || k >= sparse->nir || sparse->ir[k] >= rows) damaged(name);
          values[sparse->ir[k] * columns + c] = given[k];
        }
    };
    std::visit(place, out.values);
    list_.arrays.push_back(std::move(out));
  }

  ArrayList& list_;
};

/// libmatio trusts the sizes in a file, so impossible ones are rejected before it allocates.
void require_plausible(const std::filesystem::path& path, const matvar_t& variable,
                       std::uintmax_t file_bytes) {
  // A deflated stream is at most 1032 times as long when inflated.
  constexpr double kMostInflation = 1032.0;
  if (variable.class_type == MAT_C_SPARSE) return;  // its shape does not determine the stored size
  double bytes = 1.0;
  for (int q = 0; q < variable.rank; ++q) bytes *= static_cast<double>(variable.dims[q]);
  if (bytes > kMostInflation * static_cast<double>(file_bytes))
    throw FormatError(path, variable.name == nullptr ? "" : variable.name,
                      "its declared size exceeds the file; the file is damaged");
}

/// The default format of Octave's `save` is its own, whatever the name of the file.
std::string no_matlab_file(const std::filesystem::path& path) {
  char head[20] = {};
  std::ifstream(path, std::ios::binary).read(head, sizeof(head));
  const std::string_view begin(head, sizeof(head));
  if (begin.starts_with("# Created by Octave") || begin.starts_with("Octave-1-"))
    return "is in the native Octave format; write it in Octave with 'save -v7 FILE VARIABLES'";
  if (begin.starts_with("\x89HDF"))
    return "is HDF5, but not a MATLAB file; write it in Octave with 'save -v7 FILE VARIABLES', or "
           "rename it to .h5";
  return "is not a MATLAB file, or is damaged; use a .mat file";
}

ArrayList read_here(const std::filesystem::path& path) {
  prepare_hdf5();  // suppress the error output of HDF5
  if (H5Fis_hdf5(path.c_str()) > 0) static_cast<void>(Hdf5File::open(path));  // refuses links
  const MatFile file(Mat_Open(path.c_str(), MAT_ACC_RDONLY), &Mat_Close);
  if (!file) throw FormatError(path, "", no_matlab_file(path));
  const std::uintmax_t bytes = std::filesystem::file_size(path);
  const bool hdf5 = Mat_GetVersion(file.get()) == MAT_FT_MAT73;
  std::vector<UnreadVariable> objects;
  if (!hdf5) objects = objects_of_v5(path);
  ArrayList list{path, {}};
  Reader reader(list);
  while (true) {
    const Variable variable(Mat_VarReadNextInfo(file.get()), &Mat_VarFree);
    if (!variable) break;
    require_plausible(path, *variable, bytes);
    if (variable->name == nullptr || *variable->name == '\0') continue;
    if (Mat_VarReadDataAll(file.get(), variable.get()) != 0)
      throw FormatError(path, variable->name, "its data cannot be read; the file is damaged");
    reader.read(*variable, variable->name, 0);
  }
  list.unread.insert(list.unread.end(), objects.begin(), objects.end());
  if (hdf5) require_all_of(Hdf5File::open(list.file), "/", 0, list);
  if (list.arrays.empty() && list.unread.empty())
    throw FormatError(path, "", "contains no variables; the file is empty or damaged");
  return list;
}

}  // namespace

ArrayList read_mat(const std::filesystem::path& path) {
  require_readable(path);
  return arrays_in_child(path, read_here);
}

}  // namespace stageid
