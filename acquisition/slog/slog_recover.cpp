#include "acquisition/slog/slog_recover.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <stdexcept>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/slog/slog_appender.hpp"
#include "acquisition/slog/slog_index.hpp"
#include "acquisition/slog/slog_json.hpp"

namespace stageid {

namespace {

constexpr std::uint32_t kFillRows = 1024;
constexpr std::uint64_t kMostAdded = 2;  // times the size of the damaged log

bool are_finite(std::span<const std::byte> numbers) {
  for (std::size_t at = 0; at + sizeof(double) <= numbers.size(); at += sizeof(double)) {
    double number = 0.0;
    std::memcpy(&number, numbers.data() + at, sizeof(number));
    if (!std::isfinite(number)) return false;
  }
  return true;
}

/// Whether all measured numbers are finite. The stamp and the status of a row are no numbers.
bool are_samples(std::span<const std::byte> rows, const LogInfo& info) {
  const std::size_t row_bytes = sizeof(double) * slog_row_words(info);
  const std::size_t number_bytes = sizeof(double) * (info.actuators.size() + info.sensors.size());
  for (; rows.size() >= row_bytes; rows = rows.subspan(row_bytes))
    if (!are_finite(rows.first(number_bytes))) return false;
  return true;
}

/// Copies intact blocks to a new log and fills the gaps.
class Recovery {
 public:
  Recovery(const SlogSource& source, const std::filesystem::path& to)
      : source_(source),
        scan_(scan_slog(source, SlogScanDepth::payloads)),
        info_(index_slog(source, scan_).info),
        description_(to_json(info_)),
        out_(SlogAppender::create(to)) {}

  RecoverReport run() {
    // The first block must be a description, even if that of the old log is damaged.
    append_json(SlogBlockType::log, description_, 0);
    for (const SlogBlock& block : scan_.blocks) {
      try {
        take(block);
      } catch (const std::invalid_argument&) {
        lose(block);  // intact, but inconsistent with the format
      }
    }
    close_run();
    if (!ended_)
      append_json(SlogBlockType::end,
                  to_json(SlogEnd{1, "recovered: the writer had not closed the log"}), 0);
    out_.close();
    count_losses();
    return std::move(report_);
  }

 private:
  /// The run that is being copied.
  struct Run {
    std::uint32_t number = 0;  ///< in the old log
    SlogRunBegin begin;
    bool usable = true;  ///< its start is intact
    bool excitation = false;
  };

  void take(const SlogBlock& block) {
    ++report_.blocks_kept;
    ended_ = false;
    switch (static_cast<SlogBlockType>(block.header.type)) {
      case SlogBlockType::log:
        return;  // written before every run
      case SlogBlockType::run_begin:
        return begin_run(block.header.run, parse_run_begin(read_text(source_, block)), block);
      case SlogBlockType::excitation:
        return copy_excitation(block);
      case SlogBlockType::samples:
        return copy_samples(block);
      case SlogBlockType::run_end:
        return end_run(block);
      case SlogBlockType::end:
        close_run();
        append_json(SlogBlockType::end, to_json(parse_end(read_text(source_, block))),
                    block.header.time_ns);
        ended_ = true;
        return;
    }
    --report_.blocks_kept;
  }

  SlogBlockHeader header(SlogBlockType type, std::int64_t time_ns) const {
    SlogBlockHeader made =
        slog_header(type, run_ ? static_cast<std::uint32_t>(report_.runs - 1) : 0);
    made.time_ns = time_ns;
    return made;
  }

  void append_json(SlogBlockType type, const std::string& text, std::int64_t time_ns) {
    out_.append(header(type, time_ns), text);
  }

  void begin_run(std::uint32_t number, SlogRunBegin begin, const SlogBlock& block) {
    check_run_begin(begin, info_);
    close_run();
    // Every run has a description, but many starts of runs must not multiply a long one.
    if (may_add(description_.size()))
      append_json(SlogBlockType::log, description_, block.header.time_ns);
    run_ = Run{};
    run_->number = number;
    run_->begin = std::move(begin);
    ++report_.runs;
    append_json(SlogBlockType::run_begin, run_begin_json(run_->begin), block.header.time_ns);
  }

  /// A run whose start is lost gets realization -1 and is incomplete.
  void open_orphan(const SlogBlock& block) {
    if (run_ && run_->number == block.header.run) return;
    SlogRunBegin begin;
    begin.realization = -1;
    begin.experiment = -1;
    begin_run(block.header.run, std::move(begin), block);
    run_->usable = false;
  }

  void copy_excitation(const SlogBlock& block) {
    const bool fits = run_ && run_->number == block.header.run && run_->begin.samples == 0 &&
                      !run_->excitation &&
                      is_slog_excitation(block.header, info_, run_->begin.excitation_columns) &&
                      are_finite(read_payload(source_, block));
    if (!fits) return lose(block);
    copy(block, block.header.first_row);
    run_->excitation = true;
  }

  void copy_samples(const SlogBlock& block) {
    if (!are_slog_samples(block.header, info_) || !are_samples(read_payload(source_, block), info_))
      return lose(block);
    open_orphan(block);
    if (block.header.first_row < run_->begin.samples || !fill(block.header.first_row))
      return lose(block);
    copy(block, run_->begin.samples);
    run_->begin.samples += block.header.rows;
    report_.rows_kept += block.header.rows;
  }

  void end_run(const SlogBlock& block) {
    const LogRun end = parse_run_end(read_text(source_, block));
    open_orphan(block);
    const bool whole = end.samples >= run_->begin.samples && fill(end.samples);
    run_->begin.health = end.health;
    run_->begin.timing = end.timing;
    close_run(end.complete && whole, block.header.time_ns);
  }

  void close_run(bool complete = false, std::int64_t time_ns = 0) {
    if (!run_) return;
    const bool excited = run_->excitation || run_->begin.excitation_columns.empty();
    run_->begin.complete = complete && run_->usable && excited;
    report_.complete_runs += run_->begin.complete ? 1 : 0;
    run_->begin.health.marked += filled_;
    run_->begin.health.lost += filled_;
    append_json(SlogBlockType::run_end, run_end_json(run_->begin), time_ns);
    report_.rows_lost += filled_;
    filled_ = 0;
    run_.reset();
  }

  /// Whether so many bytes that are not in the damaged log may be written; if so, they count.
  bool may_add(std::uint64_t bytes) {
    if (bytes > kMostAdded * source_.bytes() - added_bytes_) return false;
    added_bytes_ += bytes;
    return true;
  }

  /// Appends marked rows of zeros up to `row`. @returns false if the number is implausible
  bool fill(std::uint64_t row) {
    const std::uint32_t words = slog_row_words(info_);
    const std::uint64_t missing = row - run_->begin.samples;
    if (missing > source_.bytes() || !may_add(missing * sizeof(double) * words)) return false;
    std::vector<double> rows(std::size_t{words} * kFillRows, 0.0);
    const std::uint64_t status = pack_status({0, true, 0});
    for (std::size_t r = 0; r < kFillRows; ++r)
      rows[(r + 1) * words - 1] = std::bit_cast<double>(status);
    while (run_->begin.samples < row) {
      SlogBlockHeader made = header(SlogBlockType::samples, 0);
      made.cols = words;
      made.rows =
          static_cast<std::uint32_t>(std::min<std::uint64_t>(kFillRows, row - run_->begin.samples));
      made.first_row = run_->begin.samples;
      out_.append(made, std::as_bytes(std::span(rows).first(std::size_t{made.rows} * words)));
      run_->begin.samples += made.rows;
    }
    filled_ += missing;
    return true;
  }

  void copy(const SlogBlock& block, std::uint64_t first_row) {
    SlogBlockHeader made =
        header(static_cast<SlogBlockType>(block.header.type), block.header.time_ns);
    made.cols = block.header.cols;
    made.rows = block.header.rows;
    made.first_row = first_row;
    out_.append(made, read_payload(source_, block));
  }

  void lose(const SlogBlock& block) {
    --report_.blocks_kept;
    report_.damage.push_back({block.offset, slog_block_bytes(block.header),
                              describe(block) + " does not belong to this log"});
  }

  void count_losses() {
    for (const LogDamage& damage : scan_.damage) {
      report_.damage.push_back(damage);
      report_.bytes_lost += damage.bytes;
    }
    report_.blocks_lost = scan_.blocks.back().header.sequence + 1 - report_.blocks_kept;
    const bool tail_lost =
        !scan_.damage.empty() && scan_.damage.back().offset >= scan_.blocks.back().end();
    report_.blocks_lost += tail_lost ? 1U : 0U;  // at least one; the number is unknown
  }

  const SlogSource& source_;
  SlogScan scan_;
  LogInfo info_;
  std::string description_;
  SlogAppender out_;
  RecoverReport report_;
  std::optional<Run> run_;
  std::uint64_t filled_ = 0;  ///< rows of the run
  std::uint64_t added_bytes_ = 0;
  bool ended_ = false;
};

}  // namespace

RecoverReport recover_log(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::error_code ignored;
  if (std::filesystem::equivalent(from, to, ignored))
    fail_request("{}: input and output are the same file; write the recovered log to another file",
                 from.string());
  const SlogSource source(from);
  OutputFile output(to);
  std::filesystem::remove(output.path(), ignored);  // the appender requires a new file
  RecoverReport report = Recovery(source, output.path()).run();
  output.commit();
  return report;
}

}  // namespace stageid
