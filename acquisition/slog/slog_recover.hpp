#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "acquisition/slog/slog_scan.hpp"

namespace stageid {

/// Result of verify_log(). The log is intact if `damage` is empty and `closed` is true.
struct VerifyReport {
  std::uint64_t bytes = 0;
  std::uint64_t blocks = 0;  ///< number of intact blocks; 0 for HDF5
  std::uint64_t rows = 0;    ///< number of readable rows over all runs
  std::uint64_t marked_rows = 0;
  int runs = 0;
  int complete_runs = 0;
  bool closed = false;  ///< native logs: closed properly by the writer; HDF5: always
  int exit_code = 0;    ///< of the experiment, if closed
  std::string exit_message;
  std::vector<LogDamage> damage;
  bool intact() const noexcept { return closed && damage.empty(); }
};

/// Reads every byte of a log of either format and checks all CRCs, the structure, and that all values are
/// finite.
/// @throws FileError, FormatError if it is not readable as a log.
VerifyReport verify_log(const std::filesystem::path& file);

/// Result of recover_log().
struct RecoverReport {
  std::uint64_t blocks_kept = 0;
  std::uint64_t blocks_lost = 0;  ///< derived from sequence numbers, as far as known
  std::uint64_t rows_kept = 0;
  std::uint64_t rows_lost = 0;   ///< each known lost row is replaced by a marked row of zeros
  std::uint64_t bytes_lost = 0;  ///< in damaged stretches
  int runs = 0;                  ///< in the new log
  int complete_runs = 0;
  std::vector<LogDamage> damage;
};

/// Copies all intact blocks of a native log to a new, intact log.
///
/// Missing rows inside a run become marked rows of zeros, so that the periods before and after them remain
/// usable and whole runs remain complete. They are counted in RunHealth::lost, and such runs are repeated when
/// the log is resumed. Runs without their start, excitation or end are kept as incomplete. A
/// log without end block gets one (exit code 1). `to` is written completely or not at all.
/// @throws FileError, FormatError if no block or no description of the log is left.
/// @throws std::invalid_argument if both names are the same file.
RecoverReport recover_log(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace stageid
