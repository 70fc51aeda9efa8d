#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// What a row of FitCovariance belongs to.
struct ParameterNames {
  std::vector<std::string>
      names;  ///< where it stands in model.json: submodels[1].numerator[0][y][u]
  std::vector<std::string> units;
  std::vector<double> values;
};
/// @pre result.covariance is there
ParameterNames parameter_names(const FitResult& result);

/// Writes the covariance of a fit as in docs/formats.md, whole or not at all.
/// @pre result.covariance is there   @throws FileError
void write_covariance(const std::filesystem::path& file, const FitResult& result,
                      const Eigen::VectorXd& frequency_hz);

}  // namespace stageid
