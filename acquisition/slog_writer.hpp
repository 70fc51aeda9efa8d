#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include <Eigen/Core>

#include "acquisition/log_info.hpp"

namespace stageid {

/// One sample as the loop hands it over: u (actuators), y (sensors) and its status word.
/// A row of a native log is this, as float64 + one uint64 (docs/formats.md).
struct SampleStatus {
  std::uint8_t outcome = 0;  ///< hal's Outcome as a number
  bool marked = false;       ///< do not use this sample
  std::uint32_t lateness_ns = 0;
};

/// Writes the append-only native log: blocks, each with a CRC-32C over header and payload. A block is
/// acknowledged once write() has returned for it; it then survives the death of the process, and that
/// of the machine from the next synchronize() on (called once a second and at the end of every run).
class SlogWriter {
 public:
  /// A new log. @throws FileError if `file` exists or cannot be written.
  static SlogWriter create(const std::filesystem::path& file, const LogInfo& info);

  /// Continues a log: a damaged tail is moved to FILE.damaged (nothing is lost), an unfinished run
  /// stays and counts as incomplete. @throws FormatError if `info` differs from the log's own.
  static SlogWriter resume(const std::filesystem::path& file, const LogInfo& info);

  ~SlogWriter();
  SlogWriter(SlogWriter&&) noexcept;
  SlogWriter& operator=(SlogWriter&&) noexcept;

  /// Starts a run and stores its excitation (one period, period_samples x excitation channels).
  void begin_run(const LogRun& run, const Eigen::Ref<const Eigen::MatrixXd>& excitation);
  /// Appends `rows` rows of actuators + sensors + 1 eight-byte words, row-major. One block a call.
  void write(std::span<const double> rows);
  /// Ends the run; `complete` in `run` says whether it may be used.
  void end_run(const LogRun& run);
  void synchronize();
  std::uint64_t acknowledged_rows() const noexcept;
  std::uint64_t bytes() const noexcept;
  /// Writes the end block with the exit status of the whole experiment and closes.
  void close(int exit_code, const char* message);

 private:
  struct State;
  explicit SlogWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace stageid
