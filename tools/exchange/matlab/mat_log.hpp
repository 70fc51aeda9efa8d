#pragma once

#include <filesystem>

#include "acquisition/formats/convert_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "tools/exchange/matlab/mat_file.hpp"

namespace stageid {

/// Writes a log as a MATLAB file, with the names of the HDF5 layout (docs/formats.md): sample_rate_hz, period_samples,
/// transient_periods, metadata_json, the struct channels (names and units), and one struct per run, run0000, run0001,
/// ...: realization and experiment (from 0), complete, excitation (one period), actuators, sensors (samples x
/// channels, SI) and marked. In a `map.yaml` for import they are "run0000/actuators" etc. Only one run is in memory at
/// a time; `to` is created atomically.
/// @throws FileError, FormatError
/// @throws std::invalid_argument if a run is too large for v5
void write_mat_log(const LogReader& log, const std::filesystem::path& to, MatVersion version,
                   const ConvertOptions& options = {});

}  // namespace stageid
