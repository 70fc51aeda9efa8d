#include "tests/support/logs/hdf5_surgery.hpp"

#include <stdexcept>

namespace stageid::test {
namespace {

hid_t require(hid_t id, const std::string& what) {
  if (id < 0) throw std::runtime_error("surgery: " + what);
  return id;
}

}  // namespace

Hdf5Surgery::Hdf5Surgery(const std::filesystem::path& file)
    : file_(require(H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), file.string())) {}

Hdf5Surgery::~Hdf5Surgery() { H5Fclose(file_); }

void Hdf5Surgery::poke(const std::string& dataset, std::size_t index, double value) {
  const hid_t set = require(H5Dopen2(file_, dataset.c_str(), H5P_DEFAULT), dataset);
  const hid_t space = H5Dget_space(set);
  const hid_t type = H5Dget_type(set);
  const auto count = static_cast<std::size_t>(H5Sget_simple_extent_npoints(space));
  const std::size_t words = H5Tget_class(type) == H5T_COMPOUND ? 2 : 1;
  const hid_t memory = words == 2 ? type : H5T_NATIVE_DOUBLE;
  std::vector<double> values(count * words);
  require(H5Dread(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), "read " + dataset);
  values.at(index * words) = value;
  require(H5Dwrite(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), "write " + dataset);
  H5Tclose(type);
  H5Sclose(space);
  H5Dclose(set);
}

void Hdf5Surgery::remove(const std::string& object) {
  require(H5Ldelete(file_, object.c_str(), H5P_DEFAULT), "remove " + object);
}

void Hdf5Surgery::copy(const std::string& from, const std::string& to) {
  require(H5Ocopy(file_, from.c_str(), file_, to.c_str(), H5P_DEFAULT, H5P_DEFAULT),
          "copy " + from);
}

void Hdf5Surgery::set_attribute(const std::string& object, const std::string& name,
                                long long value) {
  if (H5Aexists_by_name(file_, object.c_str(), name.c_str(), H5P_DEFAULT) > 0)
    require(H5Adelete_by_name(file_, object.c_str(), name.c_str(), H5P_DEFAULT), name);
  const hid_t space = H5Screate(H5S_SCALAR);
  const hid_t attribute =
      require(H5Acreate_by_name(file_, object.c_str(), name.c_str(), H5T_STD_I64LE, space,
                                H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
              name);
  require(H5Awrite(attribute, H5T_NATIVE_LLONG, &value), name);
  H5Aclose(attribute);
  H5Sclose(space);
}

void Hdf5Surgery::reshape(const std::string& dataset, const std::vector<hsize_t>& shape) {
  const hid_t set = require(H5Dopen2(file_, dataset.c_str(), H5P_DEFAULT), dataset);
  const hid_t type = H5Dget_type(set);
  H5Dclose(set);
  remove(dataset);
  const hid_t space = H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
  H5Dclose(require(
      H5Dcreate2(file_, dataset.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
      dataset));
  H5Sclose(space);
  H5Tclose(type);
}

}  // namespace stageid::test
