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

/// The rows of a run.
struct RunRows {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
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

/// The rows of a run of whole periods: transient ones and at least one more.
/// @throws FormatError naming the required key of the map
RunRows rows_of(const ArrayList& arrays, const ImportMap& map, const ImportMap::Run& run,
                Eigen::Index samples);

/// One period of the excitation, period_samples x channels: given as such, repeated exactly, or, if it was measured,
/// the mean of the periods after the transient.
/// @throws FormatError if the excitation does not repeat; if it repeats in pieces, the message contains the rows of
/// the runs
Eigen::MatrixXd period_of(const ArrayList& arrays, const ImportMap& map,
                          const SignalGroup& excitation, const RunRows& rows);

/// The sample rate of a log: that of the map, else that of the file. Sources in a file: the abscissas of the arrays
/// that the map names (universal files), a number or an attribute called sample_rate_hz, fs, dt or similar, or an
/// evenly spaced time axis called t or time.
/// @throws FormatError if the two differ, or neither is known
double sample_rate_of(const ArrayList& arrays, const ImportMap& map);

}  // namespace stageid
