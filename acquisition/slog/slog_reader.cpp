#include "acquisition/slog/slog_reader.hpp"

#include <algorithm>
#include <cstring>
#include <memory>
#include <set>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/record/log_checks.hpp"
#include "acquisition/record/row_transpose.hpp"
#include "acquisition/slog/crc32c.hpp"

namespace stageid {

namespace {

/// Of a run that lost samples in recovery and was repeated, the repetition counts.
void leave_out_repeated(std::vector<LogRun>& runs) {
  std::set<std::pair<int, int>> later;
  for (auto run = runs.rbegin(); run != runs.rend(); ++run) {
    if (!run->complete) continue;
    const bool is_last = later.insert({run->realization, run->experiment}).second;
    if (!is_last && run->health.lost > 0) run->complete = false;
  }
}

// Size of the pieces that are read, checked and transposed within the second-level cache.
constexpr std::size_t kPieceBytes = std::size_t{1} << 17;

/// Blocks whose headers are in memory at the same time: 0.3 MB.
constexpr std::size_t kScanBlocks = 4096;

}  // namespace

/// The requested rows and their destination.
struct SlogReader::Target {
  std::uint64_t first;
  std::uint64_t end;
  LogSamples& out;
};

SlogReader::SlogReader(const std::filesystem::path& file, bool damaged_is_error,
                       SlogScanDepth depth)
    : source_(file), scanner_(depth) {
  scan();
  if (damaged_is_error && !damage().empty()) {
    const LogDamage first = damage().front();
    fail_format(file, "",
                "damaged at byte {}: {}; use 'stageid log recover' to copy the intact parts",
                first.offset, first.what);
  }
  if (damaged_is_error && !end())
    throw FormatError(file, "",
                      "was not closed because its writer crashed or is still running; continue it "
                      "with --resume, or use 'stageid log recover'");
}

void SlogReader::scan() {
  do {
    indexer_.take(source_, scanner_.next(source_, kScanBlocks));
  } while (!scanner_.is_at_end(source_));
  // All but the last run known before are as they were.
  if (!runs_.empty()) runs_.pop_back();
  const std::vector<SlogRunIndex>& indexed = indexer_.index().runs;
  for (std::size_t i = runs_.size(); i < indexed.size(); ++i) runs_.push_back(indexed[i].run);
  leave_out_repeated(runs_);
  check_runs(path(), info(), runs_);
}

void SlogReader::update() {
  source_.update_bytes();
  scan();
}

std::vector<LogDamage> SlogReader::damage() const {
  std::vector<LogDamage> all = indexer_.index().damage;
  if (scanner_.tail()) all.push_back(*scanner_.tail());
  return all;
}

const SlogRunIndex& SlogReader::run_index(std::size_t run) const {
  check_run_index(path(), runs_, run);
  return indexer_.index().runs[run];
}

Eigen::MatrixXd SlogReader::excitation(std::size_t run) const {
  return read_slog_excitation(source_, info(), run_index(run));
}

void SlogReader::read(std::size_t run, std::uint64_t first, std::uint64_t count,
                      LogSamples& out) const {
  const SlogRunIndex& from = run_index(run);
  check_row_range(path(), from.run, first, count);
  resize_samples(info(), count, out);
  const auto ends_before = [](const SlogStretch& stretch, std::uint64_t row) {
    return stretch.end_row() <= row;
  };
  auto stretch = std::lower_bound(from.samples.begin(), from.samples.end(), first, ends_before);
  for (std::uint64_t row = first; row < first + count;) {
    const SlogBlock block = stretch->read_block(source_, row);
    read_block(from, block, {first, first + count, out});
    row = block.header.first_row + block.header.rows;
    if (row >= stretch->end_row()) ++stretch;
  }
}

void SlogReader::read_block(const SlogRunIndex& run, const SlogBlock& block,
                            const Target& target) const {
  const std::size_t words = block.header.cols;
  const std::size_t actuators = info().actuators.size();
  const std::size_t sensors = info().sensors.size();
  const std::size_t row_bytes = words * sizeof(double);
  const std::uint64_t padded = slog_padded(block.header.payload_bytes);
  // Whole rows and a multiple of 64 bytes, so that only the last piece has padding.
  const std::size_t piece_rows = std::max<std::size_t>(8, kPieceBytes / row_bytes / 8 * 8);
  const auto stride = static_cast<std::size_t>(target.end - target.first);
  const auto piece = std::make_unique_for_overwrite<double[]>(piece_rows * words);

  std::uint32_t crc = 0;
  std::uint64_t done = 0;
  for (std::uint64_t row = block.header.first_row; done < padded; row += piece_rows) {
    const auto size =
        static_cast<std::size_t>(std::min<std::uint64_t>(piece_rows * row_bytes, padded - done));
    source_.read(block.payload_offset() + done, piece.get(), size);
    crc = crc32c({reinterpret_cast<const std::byte*>(piece.get()), size}, crc);
    done += size;

    const std::uint64_t block_end = block.header.first_row + block.header.rows;
    const std::uint64_t from = std::max(row, target.first);
    const std::uint64_t end = std::min({row + piece_rows, block_end, target.end});
    if (from >= end) continue;
    const double* rows = piece.get() + static_cast<std::size_t>(from - row) * words;
    const auto count = static_cast<std::size_t>(end - from);
    const auto to = static_cast<std::size_t>(from - target.first);
    bool finite =
        transpose_rows(rows, words, count, actuators, target.out.actuators.data() + to, stride);
    finite &= transpose_rows(rows + actuators, words, count, sensors,
                             target.out.sensors.data() + to, stride);
    for (std::size_t r = 0; r < count; ++r) {
      std::uint64_t status = 0;
      std::memcpy(&status, rows + r * words + words - 1, sizeof status);
      target.out.marked[to + r] = mark_of(unpack_status(status));
    }
    if (!finite) {
      if (!payload_intact(source_, block)) break;  // damage has priority, because it is the cause
      throw_not_finite(path(), info(), run.run, target.first, target.out,
                       static_cast<Eigen::Index>(to), static_cast<Eigen::Index>(count));
    }
  }
  if (done < padded || crc != block.header.payload_crc)
    fail_format(path(), "",
                "run {}, rows {} to {}: the payload of {} is damaged; use 'stageid log recover' to "
                "copy the intact parts",
                run.run.name, block.header.first_row,
                block.header.first_row + block.header.rows - 1, describe(block));
}

}  // namespace stageid
