#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "acquisition/record/log_reader.hpp"

namespace stageid {

struct ConvertOptions {
  bool incomplete_runs = true;  ///< false: skip incomplete runs
  /// Called after every piece with the converted and the total number of rows; may be empty.
  std::function<void(std::uint64_t, std::uint64_t)> progress = {};
};

/// Selects the runs of a conversion and counts its progress. `reader` and `options` must outlive it.
class ConvertProgress {
 public:
  ConvertProgress(const LogReader& reader, const ConvertOptions& options);
  bool wanted(const LogRun& run) const noexcept;
  /// Reports that `rows` more rows of the selected runs are done.
  void add(std::uint64_t rows);

 private:
  const ConvertOptions& options_;
  std::uint64_t done_ = 0;
  std::uint64_t total_ = 0;
};

/// Writes a log of either format to `to`. The extension determines the format: .h5 or .hdf5 (the layout of
/// Hdf5LogReader, excitation one period, metadata and health as attributes), .csv, or, from an HDF5 log,
/// .slog (without lateness of the rows).
///
/// CSV: one line per sample over all runs: run, realization, experiment, time_s (from the start of the run),
/// marked, then excitation, actuators and sensors, with column headings "name [unit]". Numbers are the
/// shortest texts of the same double. Memory is bounded for any length; `to` is written completely or
/// not at all.
/// @throws std::invalid_argument for another extension. @throws FileError, FormatError
void convert_log(const LogReader& reader, const std::filesystem::path& to,
                 const ConvertOptions& options = {});

}  // namespace stageid
