#include "acquisition/files/hdf5_matrices.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "acquisition/files/fail.hpp"

namespace stageid {

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
