#pragma once

#include <filesystem>

#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/output_file.hpp"
#include "estimation/tracking/model_tracker.hpp"
#include "tools/watch/watch_source.hpp"

namespace stageid {

/// watch.h5: what was tracked, one row per period, as in docs/formats.md. Written row by row, so that the memory does not
/// grow with the log; it has its name once commit() has returned.
class TrackFile {
 public:
  /// @throws FileError
  TrackFile(const std::filesystem::path& file, const ModelTracker& tracker,
            const AdditiveModel& model, const std::filesystem::path& model_file);
  void add(const WatchedPeriod& period, const TrackedPeriod& state, const ModelTracker& tracker);
  void commit();

 private:
  OutputFile output_;
  Hdf5File hdf5_;
};

}  // namespace stageid
