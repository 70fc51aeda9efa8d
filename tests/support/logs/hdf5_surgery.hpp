#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "acquisition/files/hdf5_file.hpp"

namespace stageid::test {

/// Changes HDF5 files in place, to spoil them on purpose. Everything throws std::runtime_error.
class Hdf5Surgery {
 public:
  explicit Hdf5Surgery(const std::filesystem::path& file);

  /// Sets one number of a dataset of real or complex (then its real part) numbers, by its place in
  /// C order.
  void poke(const std::string& dataset, std::size_t index, double value);
  void remove(const std::string& object);
  void copy(const std::string& from, const std::string& to);
  void set_attribute(const std::string& object, const std::string& name, long long value);
  void set_attribute(const std::string& object, const std::string& name, const std::string& value);
  void remove_attribute(const std::string& object, const std::string& name);
  /// Replaces a dataset by zeros of another shape.
  void reshape(const std::string& dataset, const std::vector<hsize_t>& shape);

 private:
  void write_attribute(const std::string& object, const std::string& name, hid_t type,
                       const void* value);
  Hdf5Handle open(const std::string& dataset) const;

  Hdf5Handle file_;
};

}  // namespace stageid::test
