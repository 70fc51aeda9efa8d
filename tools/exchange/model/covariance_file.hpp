#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// A parameter of FitCovariance.
struct NamedParameter {
  std::string name;  ///< key in model.json: submodels[1].numerator[0][y][u]
  std::string unit;
  double value = 0.0;
};
/// The parameters of the rows of FitCovariance.
/// @pre result.covariance is not empty
std::vector<NamedParameter> named_parameters(const FitResult& result);

/// Writes the covariance of a fit as in docs/formats.md, atomically.
/// @pre result.covariance is not empty   @throws FileError
void write_covariance(const std::filesystem::path& file, const FitResult& result,
                      const Eigen::VectorXd& frequency_hz);

}  // namespace stageid
