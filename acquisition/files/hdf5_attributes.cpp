#include <cmath>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/hdf5_support.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {
namespace {

/// One attribute opened for reading.
struct Attribute : hdf5::StoredValue {
  Attribute(const Hdf5File& source, const std::string& object_name, const std::string& name)
      : StoredValue{source, object_name, "attribute '" + name + "' ", "damaged"} {
    if (!file.exists(object)) throw FormatError(file.path(), object, "is missing");
    handle = {H5Aopen_by_name(file.id(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT),
              H5Aclose};
    if (!handle) {
      hdf5::take_reason();
      fail("is missing");
    }
    set({H5Aget_type(handle.get()), H5Tclose}, {H5Aget_space(handle.get()), H5Sclose});
    count = hdf5::plausible_count(file.path(), object, hdf5::shape_of(space.get()),
                                  H5Tget_size(type.get()), false);
    if (H5Sget_simple_extent_type(space.get()) == H5S_NULL) count = 0;
  }

  void expect_one(const std::string& wanted) const {
    if (count != 1) fail("has " + std::to_string(count) + " values; expected " + wanted);
  }
  void read(hid_t memory_type, void* buffer) const {
    if (H5Aread(handle.get(), memory_type, buffer) < 0) fail_to_read();
  }
  std::vector<std::string> texts() const {
    expect(kind == Hdf5Kind::text, "strings");
    return read_texts(count, [this](hid_t memory_type, void* buffer) {
      return H5Aread(handle.get(), memory_type, buffer);
    });
  }

  Hdf5Handle handle;
  std::size_t count = 0;
};

void write_values(const Hdf5File& file, const std::string& object, const std::string& name,
                  const Hdf5Handle& space, hid_t file_type, hid_t memory_type, const void* data) {
  const auto fail = [&](const std::string& reason) {
    throw FileError(file.path().string() + ":" + object + ": cannot write attribute '" + name +
                    "': " + with_remedy(reason));
  };
  if (file.has_attribute(object, name)) fail("already exists");
  Hdf5Handle attribute(H5Acreate_by_name(file.id(), object.c_str(), name.c_str(), file_type,
                                         space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                       H5Aclose);
  if (!attribute) fail(hdf5::take_reason());
  const bool empty = H5Sget_simple_extent_npoints(space.get()) == 0;  // HDF5 requires a buffer
  if (!empty && H5Awrite(attribute.get(), memory_type, data) < 0) fail(hdf5::take_reason());
  if (!attribute.close()) fail(hdf5::take_reason());
}

Hdf5Handle scalar_space() { return {H5Screate(H5S_SCALAR), H5Sclose}; }

Hdf5Handle list_space(std::size_t count) {
  const hsize_t extent = count;
  return {H5Screate_simple(1, &extent, nullptr), H5Sclose};
}

}  // namespace

bool Hdf5File::has_attribute(const std::string& object, const std::string& name) const {
  if (!exists(object)) return false;
  const bool found = H5Aexists_by_name(id(), object.c_str(), name.c_str(), H5P_DEFAULT) > 0;
  H5Eclear2(H5E_DEFAULT);
  return found;
}

std::vector<std::string> Hdf5File::attributes(const std::string& object) const {
  if (!exists(object)) throw FormatError(path_, object, "is missing");
  std::vector<std::string> names;
  if (H5Aiterate_by_name(id(), object.c_str(), H5_INDEX_NAME, H5_ITER_INC, nullptr,
                         hdf5::collect_name<H5A_info_t>, &names, H5P_DEFAULT) < 0)
    fail_format(path_, object,
                "its attributes cannot be listed{}; the file is damaged, copy it again",
                hdf5::take_system_reason());
  return names;
}

Hdf5Kind Hdf5File::attribute_kind(const std::string& object, const std::string& name) const {
  return Attribute(*this, object, name).kind;
}

double Hdf5File::read_real_attribute(const std::string& object, const std::string& name) const {
  const Attribute attribute(*this, object, name);
  attribute.expect_number("a number");
  attribute.expect_one("one number");
  double value = 0.0;
  attribute.read(H5T_NATIVE_DOUBLE, &value);
  return value;
}

long long Hdf5File::read_integer_attribute(const std::string& object,
                                           const std::string& name) const {
  const Attribute attribute(*this, object, name);
  attribute.expect_number("an integer");
  attribute.expect_one("one integer");
  if (attribute.kind == Hdf5Kind::integer) {
    long long value = 0;
    attribute.read(H5T_NATIVE_LLONG, &value);
    return value;
  }
  double value = 0.0;
  attribute.read(H5T_NATIVE_DOUBLE, &value);
  constexpr double kLimit = 0x1p53;  // above it, a double cannot represent every integer
  if (!(std::abs(value) <= kLimit) || value != std::trunc(value))
    attribute.fail("is " + std::to_string(value) + "; expected an integer");
  return static_cast<long long>(value);
}

std::string Hdf5File::read_text_attribute(const std::string& object,
                                          const std::string& name) const {
  const Attribute attribute(*this, object, name);
  attribute.expect(attribute.kind == Hdf5Kind::text, "a string");
  attribute.expect_one("one string");
  return attribute.texts().front();
}

std::vector<double> Hdf5File::read_reals_attribute(const std::string& object,
                                                   const std::string& name) const {
  const Attribute attribute(*this, object, name);
  attribute.expect_number("numbers");
  std::vector<double> values(attribute.count);
  if (!values.empty()) attribute.read(H5T_NATIVE_DOUBLE, values.data());
  return values;
}

std::vector<std::string> Hdf5File::read_texts_attribute(const std::string& object,
                                                        const std::string& name) const {
  return Attribute(*this, object, name).texts();
}

void Hdf5File::write_attribute(const std::string& object, const std::string& name, double value) {
  write_values(*this, object, name, scalar_space(), H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &value);
}

void Hdf5File::write_attribute(const std::string& object, const std::string& name,
                               long long value) {
  write_values(*this, object, name, scalar_space(), H5T_STD_I64LE, H5T_NATIVE_LLONG, &value);
}

void Hdf5File::write_attribute(const std::string& object, const std::string& name,
                               const std::string& value) {
  const Hdf5Handle type = hdf5::text_type(H5T_CSET_UTF8);
  const char* pointer = value.c_str();
  write_values(*this, object, name, scalar_space(), type.get(), type.get(), &pointer);
}

void Hdf5File::write_attribute(const std::string& object, const std::string& name,
                               const std::vector<std::string>& values) {
  const Hdf5Handle type = hdf5::text_type(H5T_CSET_UTF8);
  std::vector<const char*> pointers;
  for (const std::string& value : values) pointers.push_back(value.c_str());
  write_values(*this, object, name, list_space(values.size()), type.get(), type.get(),
               pointers.data());
}

void Hdf5File::write_attribute(const std::string& object, const std::string& name,
                               const std::vector<double>& values) {
  write_values(*this, object, name, list_space(values.size()), H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE,
               values.data());
}

}  // namespace stageid
