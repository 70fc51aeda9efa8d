#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// The parameters of the rows of FitCovariance.
struct NamedParameters {
  std::vector<std::string> names;  ///< key in model.json: submodels[1].numerator[0][y][u]
  std::vector<std::string> units;
  std::vector<double> values;

  void add(const std::string& name, const std::string& unit, double value);
};
/// @param parameters rows of the covariance; the number of free delays follows from it
NamedParameters named_parameters(const AdditiveModel& model, Eigen::Index parameters);

/// Writes the covariance of a fit as in docs/formats.md, atomically.
/// @pre result.covariance is not empty   @throws FileError
void write_covariance(const std::filesystem::path& file, const FitResult& result,
                      const Eigen::VectorXd& frequency_hz);

/// FitCovariance::sandwich of the file. @throws FileError, FormatError also if it belongs to another model
Eigen::MatrixXd read_covariance(const std::filesystem::path& file, const AdditiveModel& model);

}  // namespace stageid
