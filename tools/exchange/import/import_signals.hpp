#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "tools/exchange/arrays/named_array.hpp"
#include "tools/exchange/import/import_map.hpp"
#include "tools/exchange/import/number_pattern.hpp"

namespace stageid {

using SampleRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The axes realization, experiment and run with an extent or an index from 0.
using RunAxes = std::map<std::string, std::size_t>;

/// Location of a run in a file: numbers in the names of arrays, and indices along their axes.
struct RunPlace {
  RunNumbers names;
  RunAxes indices;  ///< of all three axes
};

/// A group of channels with all its samples of one run, in SI units.
struct SignalGroup {
  ChannelList channels;
  SampleRows samples;
};

/// The extents of the axes that the groups' arrays have; they must agree.
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
