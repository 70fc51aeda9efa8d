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

/// One run of a native log and where its blocks stand.
struct SlogRunIndex {
  LogRun run;
  bool ended = false;  ///< its run_end is there
  std::vector<int> excitation_columns;
  std::optional<SlogBlock> excitation;
  std::vector<SlogBlock> samples;  ///< without gap: first_row of each is where the last one ended
};

/// A native log as far as it is intact.
struct SlogIndex {
  LogInfo info;
  std::vector<SlogRunIndex> runs;
  std::vector<LogDamage> damage;  ///< of the scan, and what does not fit together
  std::optional<SlogEnd> end;     ///< the last block, if that is an end block
  std::uint64_t blocks = 0;       ///< intact ones
  std::uint64_t next_sequence = 0;
  std::uint32_t log_id = 0;
};

/// Puts the blocks of a scan together. A run from which blocks are missing is given up to the gap,
/// as incomplete.
/// @throws FormatError if no description of the log is left, or one does not make sense.
SlogIndex index_slog(const SlogSource& source, const SlogScan& scan);

/// Words of a row of samples: actuators, sensors, status.
std::uint32_t slog_row_words(const LogInfo& info) noexcept;

/// Name of a run by its index: "0000".
std::string slog_run_name(std::size_t index);

/// One period of a run's excitation, period_samples x excitation channels.
/// @throws FormatError if its block is damaged or missing.
Eigen::MatrixXd read_slog_excitation(const SlogSource& source, const LogInfo& info,
                                     const SlogRunIndex& run);

}  // namespace stageid
