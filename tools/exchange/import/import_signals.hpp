#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "tools/exchange/arrays/named_array.hpp"
#include "tools/exchange/import/import_map.hpp"
#include "tools/exchange/import/number_pattern.hpp"

namespace stageid {

using SampleRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Location of a run in a file: numbers in the names of arrays, and indices along their axes.
struct RunPlace {
  RunNumbers names;
  Eigen::Index realization = 0, experiment = 0, run = 0;  ///< along the corresponding axis, from 0
};

/// Extents of the axes of a map's arrays; 1 if there is no such axis.
struct RunAxes {
  Eigen::Index realizations = 1, experiments = 1, runs = 1;
  bool has_realizations = false, has_experiments = false, has_runs = false;
};

/// A group of channels with all its samples of one run, in SI units.
struct SignalGroup {
  ChannelList channels;
  SampleRows samples;
};

/// The extents of the axes of all groups' arrays; they must agree.
/// @throws FormatError
RunAxes run_axes_of(const ArrayList& arrays, const ImportMap& map);

/// The numbers found by the patterns of the map in the names of arrays; one entry without numbers if it has no
/// patterns.
/// @throws FormatError if nothing matches
std::vector<RunNumbers> name_numbers_of(const ArrayList& arrays, const ImportMap& map);

/// @param key "sensors", for errors   @param notes receives the conversions to SI units
/// @throws FormatError naming the file and the array, or the map and the key
SignalGroup read_signals(const ArrayList& arrays, const ImportMap& map, const char* key,
                         const ImportMap::Signals& group, const RunPlace& place,
                         std::vector<std::string>& notes);

}  // namespace stageid
