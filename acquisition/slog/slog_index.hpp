#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "acquisition/slog/slog_json.hpp"
#include "acquisition/slog/slog_scan.hpp"

namespace stageid {

/// One run of a native log and the positions of its blocks.
struct SlogRunIndex {
  LogRun run;
  bool ended = false;  ///< has a run_end block
  std::vector<int> excitation_columns;
  std::optional<SlogBlock> excitation;
  std::vector<SlogBlock> samples;  ///< contiguous: no rows between two blocks
};

/// The intact part of a native log.
struct SlogIndex {
  LogInfo info;
  std::vector<SlogRunIndex> runs;
  std::vector<LogDamage> damage;  ///< of the scan, and inconsistent blocks
  std::optional<SlogEnd> end;     ///< the last block, if it is an end block
  std::uint64_t blocks = 0;       ///< number of intact blocks
  std::uint64_t next_sequence = 0;
  std::uint32_t log_id = 0;
};

/// Assembles the blocks of a scan. A run with missing blocks is truncated at the gap and incomplete.
/// @throws FormatError if no description of the log is left, or one is invalid.
SlogIndex index_slog(const SlogSource& source, const SlogScan& scan);

/// @throws std::invalid_argument unless a run of this log can start like this
void check_run_begin(const SlogRunBegin& begin, const LogInfo& info);
/// Whether the numbers in a header are those of an excitation or of samples of this log.
bool is_slog_excitation(const SlogBlockHeader& header, const LogInfo& info,
                        const std::vector<int>& columns) noexcept;
bool are_slog_samples(const SlogBlockHeader& header, const LogInfo& info) noexcept;

/// Words per row of samples: actuators, sensors, stamp if there are any, status.
std::uint32_t slog_row_words(const LogInfo& info) noexcept;

/// Name of a run by its index: "0000".
std::string slog_run_name(std::size_t index);

/// One period of a run's excitation, period_samples x excitation channels.
/// @throws FormatError if its block is damaged or missing.
Eigen::MatrixXd read_slog_excitation(const SlogSource& source, const LogInfo& info,
                                     const SlogRunIndex& run);

}  // namespace stageid
