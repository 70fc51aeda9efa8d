#include "frf/file/line_datasets.hpp"

#include "acquisition/files/fail.hpp"

namespace stageid {

void write_known(Hdf5File& file, const std::string& dataset, const Eigen::VectorXd& values) {
  if (values.size() > 0) write_vector(file, dataset, values);
}

Eigen::VectorXd read_known(const Hdf5File& file, const std::string& dataset, Eigen::Index size) {
  if (!file.exists(dataset)) return {};
  require_shape(file, dataset, {size_of(size)});
  return read_vector(file, dataset);
}

Eigen::VectorXd read_vector(const Hdf5File& file, const std::string& dataset) {
  const std::vector<hsize_t> shape = file.shape(dataset);
  if (shape.size() != 1)
    fail_format(file.path(), dataset, "shape is {}; expected a list of numbers", join_shape(shape));
  const std::vector<double> values = file.read_reals(dataset);
  return Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
}

}  // namespace stageid
