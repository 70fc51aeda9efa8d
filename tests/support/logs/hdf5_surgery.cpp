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
    : file_(require(H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), file), H5Fclose) {}

Hdf5Handle Hdf5Surgery::open(const std::string& dataset) const {
  return {require(H5Dopen2(file_.get(), dataset.c_str(), H5P_DEFAULT), dataset), H5Dclose};
}

void Hdf5Surgery::poke(const std::string& dataset, std::size_t index, double value) {
  const Hdf5Handle set = open(dataset);
  const Hdf5Handle space(H5Dget_space(set.get()), H5Sclose);
  const Hdf5Handle type(H5Dget_type(set.get()), H5Tclose);
  const auto count = static_cast<std::size_t>(H5Sget_simple_extent_npoints(space.get()));
  const std::size_t words = H5Tget_class(type.get()) == H5T_COMPOUND ? 2 : 1;
  const hid_t memory = words == 2 ? type.get() : H5T_NATIVE_DOUBLE;
  std::vector<double> values(count * words);
  require(H5Dread(set.get(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()),
          "read " + dataset);
  values.at(index * words) = value;
  require(H5Dwrite(set.get(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()),
          "write " + dataset);
}

void Hdf5Surgery::remove(const std::string& object) {
  require(H5Ldelete(file_.get(), object.c_str(), H5P_DEFAULT), "remove " + object);
}

void Hdf5Surgery::copy(const std::string& from, const std::string& to) {
  const hid_t file = file_.get();
  require(H5Ocopy(file, from.c_str(), file, to.c_str(), H5P_DEFAULT, H5P_DEFAULT), "copy " + from);
}

void Hdf5Surgery::set_attribute(const std::string& object, const std::string& name,
                                long long value) {
  write_attribute(object, name, H5T_NATIVE_LLONG, &value);
}

void Hdf5Surgery::set_attribute(const std::string& object, const std::string& name,
                                const std::string& value) {
  const Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  require(H5Tset_size(type.get(), H5T_VARIABLE), name);
  const char* const text = value.c_str();
  write_attribute(object, name, type.get(), &text);
}

void Hdf5Surgery::remove_attribute(const std::string& object, const std::string& name) {
  require(H5Adelete_by_name(file_.get(), object.c_str(), name.c_str(), H5P_DEFAULT), name);
}

void Hdf5Surgery::write_attribute(const std::string& object, const std::string& name, hid_t type,
                                  const void* value) {
  if (H5Aexists_by_name(file_.get(), object.c_str(), name.c_str(), H5P_DEFAULT) > 0)
    remove_attribute(object, name);
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle attribute(
      require(H5Acreate_by_name(file_.get(), object.c_str(), name.c_str(), type, space.get(),
                                H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
              name),
      H5Aclose);
  require(H5Awrite(attribute.get(), type, value), name);
}

void Hdf5Surgery::reshape(const std::string& dataset, const std::vector<hsize_t>& shape) {
  const Hdf5Handle type(H5Dget_type(open(dataset).get()), H5Tclose);
  remove(dataset);
  const Hdf5Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr),
                         H5Sclose);
  const Hdf5Handle set(require(H5Dcreate2(file_.get(), dataset.c_str(), type.get(), space.get(),
                                          H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                               dataset),
                       H5Dclose);
}

}  // namespace stageid::test
