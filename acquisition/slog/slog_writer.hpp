#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include <Eigen/Core>

#include "acquisition/record/log_info.hpp"
#include "acquisition/record/log_reader.hpp"
#include "acquisition/record/run_writer.hpp"
#include "acquisition/slog/slog_format.hpp"

namespace stageid {

/// Writes the append-only native log: blocks, each with a CRC-32C of header and payload. When write() has
/// returned, its block survives the death of the process. It survives that of the machine after the next
/// synchronize(), called once per second and at the end of every run.
class SlogWriter final : public RunWriter {
 public:
  /// A new log. @throws FileError if `file` exists or cannot be written.
  /// @throws std::invalid_argument from check_log_info().
  static SlogWriter create(const std::filesystem::path& file, const LogInfo& info);

  /// Continues a log: a damaged tail is moved to FILE.damaged, an unfinished run is kept as incomplete. The whole
  /// file is read and checked first.
  /// @throws FormatError if `info` differs from the log's own in more than metadata, or if there are intact blocks
  ///         after damage (recover the log first).
  /// @throws FileError if the file is missing, not writable, or being written by another process.
  static SlogWriter resume(const std::filesystem::path& file, const LogInfo& info);

  ~SlogWriter() override;
  SlogWriter(SlogWriter&&) noexcept;
  SlogWriter& operator=(SlogWriter&&) noexcept;

  /// Starts a run and stores its excitation (one period, period_samples x excitation channels).
  /// All functions below: @throws FileError if the disk is full or fails. Blocks written so far are kept, and
  /// every later call fails too. @throws std::invalid_argument for wrong sizes, values that are not finite, or a
  /// wrong order of calls.
  void begin_run(const LogRun& run, const Eigen::Ref<const Eigen::MatrixXd>& excitation) override;
  /// Appends `rows` rows of actuators + sensors + 1 eight-byte words, row-major, as one block.
  void write(std::span<const double> rows) override;
  /// Ends the run. `complete` in `run`: it may be used; `health`: its counts. Its other fields are those of
  /// begin_run().
  void end_run(const LogRun& run) override;
  /// Flushes all blocks to the medium (fdatasync).
  void synchronize() override;
  const LogInfo& info() const noexcept override;
  std::uint64_t acknowledged_rows() const noexcept;
  std::uint64_t bytes() const noexcept;
  /// Writes the end block with the exit status of the whole experiment and closes.
  void close(int exit_code, const char* message);

 private:
  struct State;
  explicit SlogWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Appends recorded samples as one block, without lateness or outcome of the cycles. If `marked` is empty, no
/// sample is marked.
void write_samples(SlogWriter& writer, const LogSamples& samples);

}  // namespace stageid
