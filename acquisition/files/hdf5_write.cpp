#include <algorithm>
#include <complex>
#include <functional>
#include <limits>
#include <numeric>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/hdf5_support.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {
namespace {

/// Names the object only if it matters: where the disk was full does not.
[[noreturn]] void fail(const Hdf5File& file, const std::string& object) {
  const std::string reason = hdf5::take_reason();
  const std::string remedied = with_remedy(reason);
  throw FileError(file.path().string() + (remedied == reason ? ":" + object : "") +
                  ": cannot be written: " + remedied);
}

/// Creation properties without time of creation: same content, same bytes.
Hdf5Handle timeless(hid_t class_id) {
  Hdf5Handle properties = hdf5::property_list(class_id);
  H5Pset_obj_track_times(properties.get(), false);
  return properties;
}

/// Numbers that were never written or were lost by damage are read as NaN, which every reader rejects,
/// instead of zero.
void fill_with_nan(hid_t properties, hid_t file_type) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::complex<double> nan(kNan, kNan);
  const Hdf5Kind kind = hdf5::kind_of(file_type);
  if (kind == Hdf5Kind::real) H5Pset_fill_value(properties, H5T_NATIVE_DOUBLE, &nan);
  if (kind == Hdf5Kind::complex)
    H5Pset_fill_value(properties, hdf5::complex_type(H5T_NATIVE_DOUBLE).get(), &nan);
}

/// Splits the dataset into blocks of rows of about a megabyte, each with a checksum, so that changed bytes are
/// detected when reading.
void protect(hid_t properties, const std::vector<hsize_t>& shape, std::size_t element_bytes) {
  constexpr hsize_t kBlockBytes = hsize_t{1} << 20;
  constexpr hsize_t kGreatestBlockBytes = hsize_t{1} << 31;  // HDF5 rejects 4 GiB and more
  if (shape.empty()) return;
  const hsize_t row_bytes =
      std::accumulate(shape.begin() + 1, shape.end(), hsize_t{element_bytes}, std::multiplies<>());
  if (shape[0] == 0 || row_bytes == 0 || row_bytes > kGreatestBlockBytes) return;
  std::vector<hsize_t> block = shape;
  block[0] = std::clamp<hsize_t>(kBlockBytes / row_bytes, 1, shape[0]);
  H5Pset_chunk(properties, static_cast<int>(block.size()), block.data());
  H5Pset_fletcher32(properties);
}

}  // namespace

void Hdf5File::create_group(const std::string& group) {
  const Hdf5Handle properties = timeless(H5P_GROUP_CREATE);
  for (std::size_t end = group.find('/', 1);; end = group.find('/', end + 1)) {
    const std::string part = group.substr(0, end);
    if (!exists(part)) {
      Hdf5Handle handle(H5Gcreate2(id(), part.c_str(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
                        H5Gclose);
      if (!handle || !handle.close()) fail(*this, part);
    }
    if (end == std::string::npos) return;
  }
}

void Hdf5File::write_dataset(const std::string& dataset, const std::vector<hsize_t>& shape,
                             hid_t file_type, hid_t memory_type, const void* data) {
  const Hdf5Handle space(
      shape.empty() ? H5Screate(H5S_SCALAR)
                    : H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr),
      H5Sclose);
  const Hdf5Handle properties = timeless(H5P_DATASET_CREATE);
  fill_with_nan(properties.get(), file_type);
  protect(properties.get(), shape, H5Tget_size(file_type));
  Hdf5Handle handle(H5Dcreate2(id(), dataset.c_str(), file_type, space.get(), H5P_DEFAULT,
                               properties.get(), H5P_DEFAULT),
                    H5Dclose);
  if (!handle) fail(*this, dataset);
  const bool empty = H5Sget_simple_extent_npoints(space.get()) == 0;
  if (!empty && H5Dwrite(handle.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0)
    fail(*this, dataset);
  if (!handle.close()) fail(*this, dataset);
}

void Hdf5File::write_reals(const std::string& dataset, const std::vector<hsize_t>& shape,
                           const double* data) {
  write_dataset(dataset, shape, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, data);
}

void Hdf5File::write_complex(const std::string& dataset, const std::vector<hsize_t>& shape,
                             const std::complex<double>* data) {
  write_dataset(dataset, shape, hdf5::complex_type(H5T_IEEE_F64LE).get(),
                hdf5::complex_type(H5T_NATIVE_DOUBLE).get(), data);
}

void Hdf5File::write_integers(const std::string& dataset, const std::vector<hsize_t>& shape,
                              const long long* data) {
  write_dataset(dataset, shape, H5T_STD_I64LE, H5T_NATIVE_LLONG, data);
}

void Hdf5File::write_texts(const std::string& dataset, const std::vector<std::string>& values) {
  // Of fixed length, because HDF5 stores texts of variable length outside the dataset, without checksum.
  std::size_t size = 1;
  for (const std::string& value : values) size = std::max(size, value.size());
  std::string padded;
  for (const std::string& value : values) {
    padded += value;
    padded.resize(padded.size() + size - value.size(), '\0');
  }
  const Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), size);
  H5Tset_strpad(type.get(), H5T_STR_NULLPAD);
  H5Tset_cset(type.get(), H5T_CSET_UTF8);
  write_dataset(dataset, {values.size()}, type.get(), type.get(), padded.data());
}

void Hdf5File::create_growing(const std::string& dataset, hsize_t columns, hid_t file_type,
                              hsize_t chunk_rows) {
  const int rank = columns == 0 ? 1 : 2;
  const hsize_t empty[2] = {0, columns};
  const hsize_t unlimited[2] = {H5S_UNLIMITED, columns};
  const hsize_t chunk[2] = {chunk_rows, columns};
  const Hdf5Handle space(H5Screate_simple(rank, empty, unlimited), H5Sclose);
  const Hdf5Handle properties = timeless(H5P_DATASET_CREATE);
  fill_with_nan(properties.get(), file_type);
  const bool chunked =
      H5Pset_chunk(properties.get(), rank, chunk) >= 0 && H5Pset_fletcher32(properties.get()) >= 0;
  Hdf5Handle handle(chunked ? H5Dcreate2(id(), dataset.c_str(), file_type, space.get(), H5P_DEFAULT,
                                         properties.get(), H5P_DEFAULT)
                            : -1,
                    H5Dclose);
  if (!handle || !handle.close()) fail(*this, dataset);
}

void Hdf5File::append(const std::string& dataset, hsize_t count, hid_t memory_type,
                      const void* data) {
  if (count == 0) return;
  const hid_t handle = open_dataset(dataset);
  std::vector<hsize_t> extent;
  {
    const Hdf5Handle space(H5Dget_space(handle), H5Sclose);
    extent = hdf5::shape_of(space.get());
  }
  std::vector<hsize_t> start(extent.size(), 0);
  start[0] = extent[0];
  extent[0] += count;
  if (H5Dset_extent(handle, extent.data()) < 0) fail(*this, dataset);
  extent[0] = count;
  const Hdf5Handle space(H5Dget_space(handle), H5Sclose);
  H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr);
  const Hdf5Handle memory(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr),
                          H5Sclose);
  if (H5Dwrite(handle, memory_type, memory.get(), space.get(), H5P_DEFAULT, data) < 0)
    fail(*this, dataset);
}

void Hdf5File::append_rows(const std::string& dataset, hsize_t count, const double* data) {
  append(dataset, count, H5T_NATIVE_DOUBLE, data);
}

void Hdf5File::append_rows(const std::string& dataset, hsize_t count, const unsigned char* data) {
  append(dataset, count, H5T_NATIVE_UCHAR, data);
}

}  // namespace stageid
