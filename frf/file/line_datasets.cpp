#include "frf/file/line_datasets.hpp"

#include <fmt/format.h>

#include "acquisition/files/file_error.hpp"

namespace stageid {

void write_known(Hdf5File& file, const std::string& dataset, const Eigen::VectorXd& values) {
  if (values.size() > 0) file.write_reals(dataset, {size_of(values.size())}, values.data());
}

Eigen::VectorXd read_vector(const Hdf5File& file, const std::string& dataset) {
  const std::vector<hsize_t> shape = file.shape(dataset);
  if (shape.size() != 1) {
    throw FormatError(file.path(), dataset,
                      fmt::format("shape is {}; expected a list of numbers", join_shape(shape)));
  }
  const std::vector<double> values = file.read_reals(dataset);
  return Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
}

}  // namespace stageid
