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

/// Blocks of samples that follow each other in the file, with as many rows each. Of all but the first, only the place and
/// the rows are known: a log of a day has as many blocks as one wants, but few stretches.
struct SlogStretch {
  SlogBlock first;
  std::uint64_t blocks = 1;

  std::uint64_t end_row() const noexcept {
    return first.header.first_row + blocks * first.header.rows;
  }
  /// Whether a block of samples of the same run is the next one.
  bool is_continued_by(const SlogBlock& block) const noexcept;
  /// The header of the block with a row. @throws FileError; FormatError if it is not what it was
  SlogBlock read_block(const SlogSource& source, std::uint64_t row) const;
};

/// One run of a native log and the positions of its blocks.
struct SlogRunIndex {
  LogRun run;
  bool ended = false;  ///< has a run_end block
  std::vector<int> excitation_columns;
  std::optional<SlogBlock> excitation;
  std::vector<SlogStretch> samples;  ///< contiguous: no rows between two stretches
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

/// Assembles the blocks of a scan, or of its steps. A run with missing blocks is truncated at the gap and incomplete.
class SlogIndexer {
 public:
  /// @param scan that follows the ones before
  /// @throws FormatError if the first scan has no description of the log, or an invalid one.
  void take(const SlogSource& source, const SlogScan& scan);
  const SlogIndex& index() const noexcept { return index_; }

 private:
  class Step;
  SlogIndex index_;
  bool has_info_ = false;
  bool open_ = false;         // a run
  std::uint32_t number_ = 0;  // of the run
};

/// The index of a whole scan. @throws the same as SlogIndexer
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
