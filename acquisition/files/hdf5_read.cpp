#include <fmt/ranges.h>

#include <complex>
#include <new>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/hdf5_matrices.hpp"
#include "acquisition/files/hdf5_support.hpp"

namespace stageid {
namespace {

/// Properties of an open dataset before its data are read.
struct DatasetInfo : hdf5::StoredValue {
  DatasetInfo(const Hdf5File& source, const std::string& name, hid_t id)
      : StoredValue{source, name, "", "truncated or damaged"}, dataset(id) {
    set({H5Dget_type(id), H5Tclose}, {H5Dget_space(id), H5Sclose});
    shape = hdf5::shape_of(space.get());
  }

  std::size_t count() const {
    const Hdf5Handle properties(H5Dget_create_plist(dataset), H5Pclose);
    const bool compressed = H5Pget_nfilters(properties.get()) > 0;
    return hdf5::plausible_count(file.path(), object, shape, H5Tget_size(type.get()), compressed);
  }
  void expect_complex() const {
    expect(kind == Hdf5Kind::complex, "complex numbers (compound type with float members r and i)");
  }
  void read_box(hid_t memory_type, const std::vector<hsize_t>& first,
                const std::vector<hsize_t>& extent, void* out) const {
    const Hdf5Handle memory(
        H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr), H5Sclose);
    H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, first.data(), nullptr, extent.data(), nullptr);
    check_read(H5Dread(dataset, memory_type, memory.get(), space.get(), H5P_DEFAULT, out));
  }
  void check_read(herr_t status) const {
    if (status < 0) fail_to_read();
  }

  hid_t dataset;
  std::vector<hsize_t> shape;
};

template <typename Value>
std::vector<Value> read_all(const DatasetInfo& info, hid_t memory_type) {
  try {
    std::vector<Value> values(info.count());
    if (!values.empty())
      info.check_read(
          H5Dread(info.dataset, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()));
    return values;
  } catch (const std::bad_alloc&) {
    info.fail("has the size " + hdf5::text_of(info.shape) + ", which exceeds the available memory");
  }
}

}  // namespace

std::vector<hsize_t> Hdf5File::shape(const std::string& dataset) const {
  DatasetInfo info(*this, dataset, open_dataset(dataset));
  info.count();  // callers allocate buffers of this shape, so it must be plausible
  return std::move(info.shape);
}

Hdf5Kind Hdf5File::kind(const std::string& dataset) const {
  return DatasetInfo(*this, dataset, open_dataset(dataset)).kind;
}

std::vector<double> Hdf5File::read_reals(const std::string& dataset) const {
  const DatasetInfo info(*this, dataset, open_dataset(dataset));
  info.expect_number("real numbers");
  return read_all<double>(info, H5T_NATIVE_DOUBLE);
}

std::vector<std::complex<double>> Hdf5File::read_complex(const std::string& dataset) const {
  const DatasetInfo info(*this, dataset, open_dataset(dataset));
  info.expect_complex();
  const Hdf5Handle type = hdf5::complex_type(H5T_NATIVE_DOUBLE);
  return read_all<std::complex<double>>(info, type.get());
}

std::vector<std::string> Hdf5File::read_texts(const std::string& dataset) const {
  const DatasetInfo info(*this, dataset, open_dataset(dataset));
  info.expect(info.kind == Hdf5Kind::text, "a list of strings");
  if (info.shape.size() != 1)
    info.fail("has the shape " + hdf5::text_of(info.shape) + "; expected a list of strings");
  return info.read_texts(info.count(), [&info](hid_t memory_type, void* buffer) {
    return H5Dread(info.dataset, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, buffer);
  });
}

void Hdf5File::read_rows(const std::string& dataset, hsize_t first, hsize_t count,
                         double* out) const {
  const DatasetInfo info(*this, dataset, open_dataset(dataset));
  info.expect_number("real numbers");
  const std::size_t rank = info.shape.size();
  if (rank != 1 && rank != 2)
    info.fail("has the shape " + hdf5::text_of(info.shape) + "; expected rows x columns");
  if (first > info.shape[0] || count > info.shape[0] - first)
    info.fail("has " + std::to_string(info.shape[0]) + " rows, fewer than the " +
              std::to_string(first + count) + " needed");
  if (count == 0 || (rank == 2 && info.shape[1] == 0)) return;
  std::vector<hsize_t> extent = info.shape;
  extent[0] = count;
  info.read_box(H5T_NATIVE_DOUBLE, rank == 2 ? std::vector<hsize_t>{first, 0} : std::vector{first},
                extent, out);
}

template <>
void Hdf5File::read_box(const std::string& dataset, const std::vector<hsize_t>& first,
                        const std::vector<hsize_t>& extent, double* out) const {
  const DatasetInfo info(*this, dataset, open_dataset(dataset));
  info.expect_number("real numbers");
  info.read_box(H5T_NATIVE_DOUBLE, first, extent, out);
}

template <>
void Hdf5File::read_box(const std::string& dataset, const std::vector<hsize_t>& first,
                        const std::vector<hsize_t>& extent, std::complex<double>* out) const {
  const DatasetInfo info(*this, dataset, open_dataset(dataset));
  info.expect_complex();
  info.read_box(hdf5::complex_type(H5T_NATIVE_DOUBLE).get(), first, extent, out);
}

hsize_t Hdf5File::rows_of_chunk(const std::string& dataset) const {
  const Hdf5Handle properties(H5Dget_create_plist(open_dataset(dataset)), H5Pclose);
  if (H5Pget_layout(properties.get()) != H5D_CHUNKED) return 1;
  std::vector<hsize_t> chunk(H5S_MAX_RANK, 1);
  H5Pget_chunk(properties.get(), H5S_MAX_RANK, chunk.data());
  return chunk[0];
}

std::string join_shape(const std::vector<hsize_t>& shape) {
  return fmt::format("[{}]", fmt::join(shape, " x "));
}

void require_shape(const Hdf5File& file, const std::string& dataset,
                   const std::vector<hsize_t>& wanted) {
  const std::vector<hsize_t> shape = file.shape(dataset);
  if (shape != wanted)
    fail_format(file.path(), dataset, "shape is {}; expected {}", join_shape(shape),
                join_shape(wanted));
}

}  // namespace stageid
