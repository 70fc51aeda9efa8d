#pragma once

#include <filesystem>

#include "hal/stage/motion_controller.hpp"
#include "tools/exchange/arrays/npz_file.hpp"

namespace stageid::test {

inline NamedArray array_of(const char* name, const Eigen::MatrixXd& m) {
  const auto values = m.reshaped<Eigen::RowMajor>();
  return {name,
          {static_cast<std::size_t>(m.rows()), static_cast<std::size_t>(m.cols())},
          std::vector<double>(values.begin(), values.end())};
}

/// The matrices of a controller, for a file.
inline ArrayList arrays_of(const std::filesystem::path& file, const ControllerStateSpace& s) {
  return {file, {array_of("A", s.a), array_of("B", s.b), array_of("C", s.c), array_of("D", s.d)}};
}

}  // namespace stageid::test
