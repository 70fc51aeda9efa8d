#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <fstream>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/hdf5_library.hpp"
#include "tools/exchange/matlab/mat_variable.hpp"
#include "tools/terminal/unicode.hpp"

// Layout: as MATLAB's save -v7.3 and libmatio 1.5 write it.

namespace stageid {
namespace {

constexpr hsize_t kUserBlock = 512;
constexpr const char* kReferences = "#refs#";

Hdf5Handle complex_type() {
  Hdf5Handle type(H5Tcreate(H5T_COMPOUND, 2 * sizeof(double)), H5Tclose);
  H5Tinsert(type.get(), "real", 0, H5T_NATIVE_DOUBLE);
  H5Tinsert(type.get(), "imag", sizeof(double), H5T_NATIVE_DOUBLE);
  return type;
}

/// Without time of creation: same content, same bytes.
Hdf5Handle timeless(hid_t class_id) {
  Hdf5Handle properties(H5Pcreate(class_id), H5Pclose);
  H5Pset_obj_track_times(properties.get(), false);
  return properties;
}

}  // namespace

struct Mat73File::State {
  std::filesystem::path file, named;
  Hdf5Handle hdf5;
  Hdf5Handle references;  ///< the group with the cells' contents
  std::size_t cells = 0;

  void require(bool done) const {
    if (!done) fail_file(named, "cannot be written; check the disk");
  }
  Hdf5Handle made(hid_t id, Hdf5Handle::Close close) const {
    Hdf5Handle handle(id, close);
    require(static_cast<bool>(handle));
    return handle;
  }

  void put_attribute(hid_t object, const char* name, hid_t type, hsize_t count,
                     const void* data) const {
    const Hdf5Handle space =
        made(count == 0 ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &count, nullptr), H5Sclose);
    Hdf5Handle attribute =
        made(H5Acreate2(object, name, type, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    require(H5Awrite(attribute.get(), type, data) >= 0 && attribute.close());
  }

  void put_class(hid_t object, std::string_view kind) const {
    const Hdf5Handle type = made(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type.get(), kind.size());
    put_attribute(object, "MATLAB_class", type.get(), 0, kind.data());
  }

  /// An empty array is stored as its shape.
  void put_dataset(hid_t parent, const std::string& name, std::string_view kind,
                   const std::vector<std::size_t>& shape, hid_t type, const void* data) const {
    const bool empty = std::ranges::find(shape, 0U) != shape.end();
    const std::vector<std::uint64_t> extents(shape.begin(), shape.end());
    std::vector<hsize_t> stored(shape.rbegin(), shape.rend());
    if (empty) stored = {shape.size()};
    const Hdf5Handle space =
        made(H5Screate_simple(static_cast<int>(stored.size()), stored.data(), nullptr), H5Sclose);
    const hid_t stored_type = empty ? H5T_NATIVE_UINT64 : type;
    Hdf5Handle dataset =
        made(H5Dcreate2(parent, name.c_str(), stored_type, space.get(), H5P_DEFAULT,
                        timeless(H5P_DATASET_CREATE).get(), H5P_DEFAULT),
             H5Dclose);
    put_class(dataset.get(), kind);
    const std::int32_t decode = 2;  // a text is stored as numbers of two bytes
    if (kind == "char")
      put_attribute(dataset.get(), "MATLAB_int_decode", H5T_NATIVE_INT32, 0, &decode);
    const std::uint32_t yes = 1;
    if (empty) put_attribute(dataset.get(), "MATLAB_empty", H5T_NATIVE_UINT32, 0, &yes);
    require(H5Dwrite(dataset.get(), stored_type, H5S_ALL, H5S_ALL, H5P_DEFAULT,
                     empty ? static_cast<const void*>(extents.data()) : data) >= 0 &&
            dataset.close());
  }

  void put_text(hid_t parent, const std::string& name, const std::string& text) const {
    const std::u16string units = utf16_of(text);
    put_dataset(parent, name, "char", {units.empty() ? 0U : 1U, units.size()}, H5T_NATIVE_UINT16,
                units.data());
  }

  void put_cell(hid_t parent, const std::string& name, const std::vector<std::string>& texts) {
    if (!references)
      references = made(H5Gcreate2(hdf5.get(), kReferences, H5P_DEFAULT,
                                   timeless(H5P_GROUP_CREATE).get(), H5P_DEFAULT),
                        H5Gclose);
    std::vector<hobj_ref_t> cell(texts.size());
    for (std::size_t k = 0; k < texts.size(); ++k) {
      const std::string number = fmt::format("{}", cells++);
      put_text(references.get(), number, texts[k]);
      require(H5Rcreate(&cell[k], references.get(), number.c_str(), H5R_OBJECT, -1) >= 0);
    }
    put_dataset(parent, name, "cell", {texts.size(), 1}, H5T_STD_REF_OBJ, cell.data());
  }

  void put_struct(hid_t parent, const MatVariable& variable) {
    Hdf5Handle group = made(H5Gcreate2(parent, variable.name.c_str(), H5P_DEFAULT,
                                       timeless(H5P_GROUP_CREATE).get(), H5P_DEFAULT),
                            H5Gclose);
    put_class(group.get(), "struct");
    const Hdf5Handle letter = made(H5Tcopy(H5T_C_S1), H5Tclose);
    const Hdf5Handle word = made(H5Tvlen_create(letter.get()), H5Tclose);
    std::vector<hvl_t> names;
    for (const MatVariable& field : variable.fields)
      names.push_back({field.name.size(), const_cast<char*>(field.name.data())});  // only read
    put_attribute(group.get(), "MATLAB_fields", word.get(), names.size(), names.data());
    for (const MatVariable& field : variable.fields) put(group.get(), field);
    require(group.close());
  }

  void put(hid_t parent, const MatVariable& variable) {
    if (variable.array == nullptr) return put_struct(parent, variable);
    const NamedArray& array = *variable.array;
    if (array.is_text()) {
      const auto& texts = std::get<std::vector<std::string>>(array.values);
      if (array.shape.empty()) return put_text(parent, variable.name, texts.at(0));
      return put_cell(parent, variable.name, texts);
    }
    const NamedArray stored = as_matlab_stores(array);
    const auto write = [&](hid_t type, const void* data) {
      put_dataset(parent, variable.name, "double", stored.shape, type, data);
    };
    if (stored.is_complex())
      write(complex_type().get(), std::get<1>(stored.values).data());
    else
      write(H5T_NATIVE_DOUBLE, std::get<0>(stored.values).data());
  }
};

Mat73File::Mat73File(const std::filesystem::path& file, const std::filesystem::path& shown_as)
    : state_(std::make_unique<State>()) {
  prepare_hdf5();
  state_->file = file;
  state_->named = shown_as;
  const Hdf5Handle creation = timeless(H5P_FILE_CREATE);
  H5Pset_userblock(creation.get(), kUserBlock);
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_EARLIEST, H5F_LIBVER_V18);
  state_->hdf5 =
      state_->made(H5Fcreate(file.c_str(), H5F_ACC_TRUNC, creation.get(), access.get()), H5Fclose);
}

Mat73File::~Mat73File() = default;

void Mat73File::add(const MatVariable& variable) { state_->put(state_->hdf5.get(), variable); }

void Mat73File::close(std::string_view head) {
  State& state = *state_;
  const bool flushed =
      state.references.close() && H5Fflush(state.hdf5.get(), H5F_SCOPE_GLOBAL) >= 0;
  state.require(state.hdf5.close() && flushed);
  std::fstream file(state.file, std::ios::binary | std::ios::in | std::ios::out);
  file.write(head.data(), static_cast<std::streamsize>(head.size()));
  file.close();
  state.require(static_cast<bool>(file));
}

}  // namespace stageid
