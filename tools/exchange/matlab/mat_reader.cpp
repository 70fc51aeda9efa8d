#include <fmt/format.h>
#include <matio.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <string_view>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/hdf5_library.hpp"
#include "tools/exchange/arrays/arrays_in_child.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/exchange/matlab/mat_objects.hpp"
#include "tools/terminal/output_paths.hpp"
#include "tools/terminal/unicode.hpp"

namespace stageid {
namespace {

using MatFile = std::unique_ptr<mat_t, int (*)(mat_t*)>;
using Variable = std::unique_ptr<matvar_t, void (*)(matvar_t*)>;

/// 1 GiB of real numbers: the limit for a full matrix from a sparse one.
constexpr std::size_t kMostFullNumbers = std::size_t{1} << 27;

template <typename Number>
void append_numbers(const void* data, std::size_t count, std::vector<double>& out) {
  for (std::size_t k = 0; k < count; ++k) {
    Number value;
    std::memcpy(&value, static_cast<const char*>(data) + k * sizeof(Number), sizeof(Number));
    out.push_back(static_cast<double>(value));
  }
}

/// False if the type is not numeric.
bool read_numbers(matio_types type, const void* data, std::size_t count, std::vector<double>& out) {
  out.reserve(count);
  switch (type) {
    case MAT_T_DOUBLE:
      return append_numbers<double>(data, count, out), true;
    case MAT_T_SINGLE:
      return append_numbers<float>(data, count, out), true;
    case MAT_T_INT64:
      return append_numbers<std::int64_t>(data, count, out), true;
    case MAT_T_UINT64:
      return append_numbers<std::uint64_t>(data, count, out), true;
    case MAT_T_INT32:
      return append_numbers<std::int32_t>(data, count, out), true;
    case MAT_T_UINT32:
      return append_numbers<std::uint32_t>(data, count, out), true;
    case MAT_T_INT16:
      return append_numbers<std::int16_t>(data, count, out), true;
    case MAT_T_UINT16:
    case MAT_T_UTF16:
      return append_numbers<std::uint16_t>(data, count, out), true;
    case MAT_T_INT8:
      return append_numbers<std::int8_t>(data, count, out), true;
    case MAT_T_UINT8:
    case MAT_T_UTF8:
      return append_numbers<std::uint8_t>(data, count, out), true;
    default:
      return false;
  }
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
        return;  // named by objects_of_v5() and require_all_of_v73()
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
    throw FormatError(list_.file, name, "its data cannot be read; the file is damaged");
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
    const std::vector<std::size_t> shape(variable.dims, variable.dims + variable.rank);
    // Column-major: the shape reversed in C order.
    NamedArray stored{name, {shape.rbegin(), shape.rend()}, {}};
    std::vector<double> real;
    if (count > 0 && variable.data == nullptr) damaged(name);
    if (variable.isComplex == 0) {
      if (!read_numbers(variable.data_type, variable.data, count, real)) return;
      stored.values = std::move(real);
    } else {
      const auto* parts = static_cast<const mat_complex_split_t*>(variable.data);
      std::vector<double> imaginary;
      if (count > 0 && (!read_numbers(variable.data_type, parts->Re, count, real) ||
                        !read_numbers(variable.data_type, parts->Im, count, imaginary)))
        return;
      std::vector<std::complex<double>> values(count);
      for (std::size_t k = 0; k < count; ++k) values[k] = {real[k], imaginary[k]};
      stored.values = std::move(values);
    }
    list_.arrays.push_back(reversed(stored));
  }

  /// As a full matrix, because channels and samples are full.
  void read_sparse(const matvar_t& variable, const std::string& name) {
    const auto* sparse = static_cast<const mat_sparse_t*>(variable.data);
    const std::size_t rows = variable.dims[0];
    const std::size_t columns = variable.dims[1];
    if (sparse == nullptr || sparse->jc == nullptr || sparse->njc != columns + 1) damaged(name);
    if (columns > 0 && rows > kMostFullNumbers / columns)
      throw FormatError(list_.file, name,
                        fmt::format("is a sparse matrix of {} x {}, too large for a full one. Save "
                                    "the needed part with full()",
                                    rows, columns));
    const std::size_t count = sparse->ndata;
    std::vector<double> real, imaginary;
    const auto* parts = static_cast<const mat_complex_split_t*>(sparse->data);
    const bool complex = variable.isComplex != 0;
    if (count > 0 &&
        (sparse->data == nullptr ||
         !read_numbers(variable.data_type, complex ? parts->Re : sparse->data, count, real) ||
         (complex && !read_numbers(variable.data_type, parts->Im, count, imaginary))))
      damaged(name);
    std::vector<std::complex<double>> values(rows * columns);
    for (std::size_t c = 0; c < columns; ++c)
      for (std::size_t k = sparse->jc[c]; k < sparse->jc[c + 1]; ++k) {
        if (k >= count || k >= sparse->nir || sparse->ir[k] >= rows) damaged(name);
        values[sparse->ir[k] * columns + c] = {real[k], complex ? imaginary[k] : 0.0};
      }
    NamedArray out{name, {rows, columns}, {}};
    if (complex) {
      out.values = std::move(values);
    } else {
      std::vector<double> numbers;
      numbers.reserve(values.size());
      for (const std::complex<double>& value : values) numbers.push_back(value.real());
      out.values = std::move(numbers);
    }
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

/// libmatio does not detect a truncated file: it treats the end as that of the last variable. In v5 files, the
/// elements after the header of 128 bytes, each with type and size first, must end at the end of the file.
void require_whole(const std::filesystem::path& path, std::uintmax_t file_bytes) {
  std::ifstream stream(path, std::ios::binary);
  char head[kHeadBytes] = {};
  if (!stream.read(head, sizeof(head)) || !std::string_view(head, 10).starts_with("MATLAB 5.0"))
    return;
  const bool big_endian = head[126] == 'M';
  std::uintmax_t at = kHeadBytes;
  while (at < file_bytes) {
    unsigned char tag[8] = {};
    stream.seekg(static_cast<std::streamoff>(at));
    stream.read(reinterpret_cast<char*>(tag), sizeof(tag));
    std::uint32_t bytes = 0;
    for (unsigned k = 0; k < 4; ++k)
      bytes |= static_cast<std::uint32_t>(tag[4 + k]) << (8 * (big_endian ? 3 - k : k));
    at += sizeof(tag) + bytes;
  }
  if (at != file_bytes)
    throw FormatError(path, "", "unexpected end of file; the file is truncated or damaged");
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
  require_whole(path, bytes);
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
  if (Mat_GetVersion(file.get()) == MAT_FT_MAT73)
    require_all_of_v73(list);
  else
    for (UnreadVariable& object : objects_of_v5(path)) list.unread.push_back(std::move(object));
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
