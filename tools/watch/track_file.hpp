#pragma once

#include <filesystem>
#include <string>
#include <vector>

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
            const AdditiveModel& model, const std::filesystem::path& model_file,
            const WatchSource& source);
  void add(const WatchedPeriod& period, const TrackedPeriod& state, const ModelTracker& tracker);
  /// Adds the last response and covariance.
  void commit(const ModelTracker& tracker);

 private:
  Eigen::Index outputs_;
  OutputFile output_;
  Hdf5File hdf5_;
};

/// What was tracked at some times.
struct WatchedTracks {
  std::string started_utc;  ///< of the log; may be empty
  std::vector<std::string> names;
  std::vector<TrackedKind> kinds;
  std::vector<double> nominal;  ///< values of the model
  std::vector<double> time_s;   ///< since the start of the log
  Eigen::MatrixXd change;       ///< times x properties, as tracked
  Eigen::MatrixXd deviation;
};

/// The last period of each `every_s` seconds of recorded time, without those that were learned from.
/// @throws FileError, FormatError
WatchedTracks read_tracks(const std::filesystem::path& file, double every_s);

}  // namespace stageid
