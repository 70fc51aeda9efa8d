#pragma once

#include <pybind11/numpy.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "tools/python/arguments.hpp"

namespace stageid {

/// Samples of a whole experiment, one array per group. M realizations of E experiments (runs) of S samples each, and
/// one period of P samples of excitation.
struct ExperimentArrays {
  RealArray excitation;             ///< [M x E x P x n_r]
  RealArray actuators;              ///< [M x E x S x n_u]
  RealArray sensors;                ///< [M x E x S x n_y]
  std::optional<FlagArray> marked;  ///< [M x E x S], nonzero: do not use
};

/// The arguments r, u, y and marked (None: nothing is marked) of a log.
/// @throws as real_array() and flag_array()
ExperimentArrays experiment_arrays(const py::object& r, const py::object& u, const py::object& y,
                                   const py::object& marked);

/// A log in Python arrays. They are not copied if the channels of a sample are contiguous (C order, slices of it,
/// views of other records), otherwise once.
///
/// Must be created and destroyed with the lock of the interpreter; read() does not need it.
class ArrayLog final : public LogReader {
 public:
  /// @param name for messages and provenance
  /// @throws std::invalid_argument if shapes do not match each other or the channels of `info`
  /// @throws FormatError from check_runs(): whole periods, more than the transient ones
  ArrayLog(std::filesystem::path name, LogInfo info, ExperimentArrays arrays);

  const std::filesystem::path& path() const noexcept override { return name_; }
  const LogInfo& info() const noexcept override { return info_; }
  const std::vector<LogRun>& runs() const noexcept override { return runs_; }
  Eigen::MatrixXd excitation(std::size_t run) const override;
  /// @throws FormatError if a value is not finite
  void read(std::size_t run, std::uint64_t first, std::uint64_t count,
            LogSamples& out) const override;

  const ExperimentArrays& arrays() const noexcept { return arrays_; }

 private:
  struct Rows {
    const double* first = nullptr;
    std::size_t words = 0;  ///< from one sample to the next
  };

  void check_shapes() const;
  void locate_runs();
  static Rows rows_of(const RealArray& array, py::ssize_t realization, py::ssize_t experiment);

  std::filesystem::path name_;
  LogInfo info_;
  ExperimentArrays arrays_;
  std::vector<LogRun> runs_;
  std::vector<Rows> actuators_;  // one per run, as the following two
  std::vector<Rows> sensors_;
  std::vector<Eigen::Array<std::uint8_t, Eigen::Dynamic, 1>> marked_;
};

}  // namespace stageid
