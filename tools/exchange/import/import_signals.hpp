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

/// Where a run is in a file: numbers in the names of arrays, and places along their axes.
struct RunPlace {
  RunNumbers names;
  Eigen::Index realization = 0, experiment = 0, run = 0;  ///< along the axis of that name, from 0
};

/// How often the axes of a map's arrays repeat; 1 where there is no such axis.
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

/// The numbers that the map's patterns find in the names of arrays; one entry without numbers if it has none.
/// @throws FormatError if nothing matches
std::vector<RunNumbers> name_numbers_of(const ArrayList& arrays, const ImportMap& map);

/// @param key "sensors", for errors   @param notes gets what was converted to SI units
/// @throws FormatError naming the file and the array, or the map and the key
SignalGroup read_signals(const ArrayList& arrays, const ImportMap& map, const char* key,
                         const ImportMap::Signals& group, const RunPlace& place,
                         std::vector<std::string>& notes);

}  // namespace stageid
