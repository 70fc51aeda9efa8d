#pragma once

#include <hdf5.h>

#include <filesystem>
#include <string>
#include <vector>

namespace stageid::test {

/// Changes HDF5 files in place, to spoil them on purpose. Everything throws std::runtime_error.
class Hdf5Surgery {
 public:
  explicit Hdf5Surgery(const std::filesystem::path& file);
  ~Hdf5Surgery();
  Hdf5Surgery(Hdf5Surgery&&) = delete;

  /// Sets one number of a dataset of real or complex (then its real part) numbers, by its place in
  /// C order.
  void poke(const std::string& dataset, std::size_t index, double value);
  void remove(const std::string& object);
  void copy(const std::string& from, const std::string& to);
  void set_attribute(const std::string& object, const std::string& name, long long value);
  /// Replaces a dataset by zeros of another shape.
  void reshape(const std::string& dataset, const std::vector<hsize_t>& shape);

 private:
  hid_t file_;
};

}  // namespace stageid::test
