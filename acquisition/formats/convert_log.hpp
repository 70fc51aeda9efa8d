#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "acquisition/record/log_reader.hpp"

namespace stageid {

struct ConvertOptions {
  bool incomplete_runs = true;  ///< false: leave runs out that were broken off
  /// Called after every piece with rows done and rows in all; may be empty.
  std::function<void(std::uint64_t, std::uint64_t)> progress = {};
};

/// Which runs a conversion takes, and how far it is. `reader` and `options` stay until it is done.
class ConvertProgress {
 public:
  ConvertProgress(const LogReader& reader, const ConvertOptions& options);
  bool wanted(const LogRun& run) const noexcept;
  /// Tells the caller that `rows` more rows of the wanted runs are done.
  void add(std::uint64_t rows);

 private:
  const ConvertOptions& options_;
  std::uint64_t done_ = 0;
  std::uint64_t total_ = 0;
};

/// Writes a log of either format to `to`, by its extension: .h5 or .hdf5 (the layout of
/// Hdf5LogReader, excitation one period, metadata and health as attributes), .csv, or of an HDF5 log
/// .slog, whose rows know no lateness.
///
/// CSV: one line a sample over all runs: run, realization, experiment, time_s (from the start of
/// the run), marked, then excitation, actuators and sensors, each column headed "name [unit]".
/// Numbers are the shortest that read back to the same double. Memory is bounded whatever the
/// length; `to` appears whole or not at all.
/// @throws std::invalid_argument for another extension. @throws FileError, FormatError
void convert_log(const LogReader& reader, const std::filesystem::path& to,
                 const ConvertOptions& options = {});

}  // namespace stageid
