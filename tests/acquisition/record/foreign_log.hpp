#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "acquisition/files/hdf5_file.hpp"
#include "tests/acquisition/record/small_log.hpp"

// The small log as another program would write it in HDF5: values row by row, with variations.
namespace stageid::test::foreign_log {

using Shape = std::vector<hsize_t>;

inline constexpr std::uint64_t kRows = 3 * kPeriod;

/// value(row, column) row by row.
template <typename Value>
std::vector<double> values_of(std::uint64_t rows, int columns, Value value) {
  std::vector<double> values;
  for (std::uint64_t n = 0; n < rows; ++n)
    for (int c = 0; c < columns; ++c) values.push_back(value(n, c));
  return values;
}

inline std::vector<double> actuators(std::size_t run, std::uint64_t rows = kRows) {
  return values_of(rows, 3, [&](std::uint64_t n, int c) { return actuator_value(run, n, c); });
}

inline std::vector<double> sensors(std::size_t run, std::uint64_t rows = kRows) {
  return values_of(rows, 2, [&](std::uint64_t n, int c) { return sensor_value(run, n, c); });
}

inline std::vector<double> excitation(std::size_t run, std::uint64_t rows) {
  const Eigen::MatrixXd period = excitation_of(run);
  return values_of(rows, 3, [&](std::uint64_t n, int c) {
    return period(static_cast<Eigen::Index>(n % kPeriod), c);
  });
}

/// A log of another program. Every part can be omitted or replaced.
struct Foreign {
  std::string format = "stageid-log";
  long long version = 1;
  double sample_rate_hz = 1000.0;
  long long period_samples = kPeriod;
  long long transient_periods = 1;
  std::vector<std::string> sensor_units = {"m"};
  std::string left_out = {};  ///< object that is not written
  std::vector<std::pair<long long, long long>> ids = {{0, 0}, {0, 1}};
  bool whole_excitation = false;
  /// Called last, with the open file.
  std::function<void(Hdf5File&)> change = [](Hdf5File&) {};
};

}  // namespace stageid::test::foreign_log
