#pragma once

#include <cstddef>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/record/log_reader.hpp"

namespace stageid {

/// Debian's HDF5 is not thread-safe: log reader and writer hold this mutex while they call it.
std::mutex& hdf5_mutex() noexcept;

/// Reads logs of the layout in docs/formats.md, written by other programs or convert_log().
class Hdf5LogReader final : public LogReader {
 public:
  /// Checks attributes, shapes and run lengths; values are checked when they are read.
  /// @throws FileError, FormatError naming the object.
  explicit Hdf5LogReader(const std::filesystem::path& file);
  ~Hdf5LogReader() override;

  const std::filesystem::path& path() const noexcept override { return path_; }
  const LogInfo& info() const noexcept override { return info_; }
  const std::vector<LogRun>& runs() const noexcept override { return runs_; }
  Eigen::MatrixXd excitation(std::size_t run) const override;
  void read(std::size_t run, std::uint64_t first, std::uint64_t count,
            LogSamples& out) const override;

 private:
  /// value = scale * stored + offset, one pair per column; both empty: as stored.
  struct Scaling {
    std::vector<double> scale;
    std::vector<double> offset;
  };
  struct Dataset {
    std::string name;
    Scaling scaling;
    std::uint64_t rows = 0;
  };
  struct Run {
    Dataset excitation;
    Dataset actuators;
    Dataset sensors;
    std::string marked;  ///< empty: no sample is marked
  };

  void read_channels();
  void read_run(const std::string& name);
  Dataset open_dataset(const std::string& name, std::size_t columns) const;
  Scaling read_scaling(const std::string& dataset, std::size_t columns) const;
  void check_excitation_length(const LogRun& run, const Dataset& excitation) const;
  void check_repetition(const LogRun& run, const Dataset& dataset,
                        const Eigen::MatrixXd& period) const;
  void read_columns(const Dataset& dataset, std::uint64_t first, Eigen::MatrixXd& out) const;
  void read_marked(const std::string& dataset, std::uint64_t first, LogSamples& out) const;

  std::filesystem::path path_;
  std::optional<Hdf5File> file_;  ///< optional, so that it can be closed under the lock
  LogInfo info_;
  std::vector<LogRun> runs_;
  std::vector<Run> places_;
};

}  // namespace stageid
