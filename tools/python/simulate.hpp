#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include "acquisition/record/run_writer.hpp"

namespace stageid {

/// All runs of an experiment in contiguous memory.
class RunMemory final : public RunWriter {
 public:
  /// @param runs, samples expected number of runs and of rows per run
  RunMemory(LogInfo info, std::size_t runs, std::size_t samples);

  const LogInfo& info() const noexcept override { return info_; }
  void begin_run(const LogRun& run, const Eigen::Ref<const Eigen::MatrixXd>& excitation) override;
  void write(std::span<const double> rows) override;
  void end_run(const LogRun& /*run*/) override {}
  void synchronize() override {}

  /// Rows of actuators + sensors + status word (slog_format.hpp), run after run.
  const std::vector<double>& rows() const noexcept { return rows_; }
  /// One period per run, sample by sample, run after run.
  const std::vector<double>& excitation() const noexcept { return excitation_; }

 private:
  LogInfo info_;
  std::vector<double> rows_;
  std::vector<double> excitation_;
};

/// An experiment on the simulated stage, in memory.
struct SimulatedExperiment {
  std::filesystem::path name;  ///< of the experiment file
  int realizations = 0;
  int experiments = 0;      ///< of each
  std::size_t samples = 0;  ///< of each run
  std::unique_ptr<RunMemory> runs;
};

/// Performs an experiment file on its simulated stage in virtual time: the same samples as
/// `stageid run CONFIG --backend sim --pace 0`.
/// @throws FileError, FormatError, std::invalid_argument; Interrupted
/// @throws StageError naming the limit or fault that ended the experiment
SimulatedExperiment simulate_experiment(const std::filesystem::path& config);

}  // namespace stageid
