#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// Samples of a part of one run. Column-major: one channel is contiguous in memory.
struct LogSamples {
  Eigen::MatrixXd actuators;                             ///< rows x actuators, SI
  Eigen::MatrixXd sensors;                               ///< rows x sensors, SI
  Eigen::Array<std::uint8_t, Eigen::Dynamic, 1> marked;  ///< rows; nonzero: do not use
};

/// Reads either log format in bounded memory.
class LogReader {
 public:
  virtual ~LogReader() = default;
  virtual const std::filesystem::path& path() const noexcept = 0;
  virtual const LogInfo& info() const noexcept = 0;
  virtual const std::vector<LogRun>& runs() const noexcept = 0;

  /// One period of the excitation of run `run`, period_samples x excitation channels.
  /// @throws FormatError if the log contains the whole excitation and it is not periodic.
  virtual Eigen::MatrixXd excitation(std::size_t run) const = 0;

  /// Reads rows [first, first + count) of a run into `out`, whose matrices are resized if necessary.
  /// Safe to call from several threads at once, each with its own `out` (the HDF5 reader serializes).
  /// @throws FormatError naming run and row if a value is not finite or a block is damaged.
  virtual void read(std::size_t run, std::uint64_t first, std::uint64_t count,
                    LogSamples& out) const = 0;
};

}  // namespace stageid
