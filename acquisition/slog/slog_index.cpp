#include "acquisition/slog/slog_index.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "acquisition/files/fail.hpp"

namespace stageid {

namespace {

bool has_its_bytes(const SlogBlockHeader& header) noexcept {
  return header.payload_bytes == std::uint64_t{8} * header.rows * header.cols;
}

}  // namespace

bool SlogStretch::is_continued_by(const SlogBlock& block) const noexcept {
  return block.header.rows == first.header.rows &&
         block.header.payload_bytes == first.header.payload_bytes &&
         block.header.sequence == first.header.sequence + blocks &&
         block.offset == first.offset + blocks * slog_block_bytes(first.header);
}

SlogBlock SlogStretch::read_block(const SlogSource& source, std::uint64_t row) const {
  const std::uint64_t n = (row - first.header.first_row) / first.header.rows;
  SlogBlock block{first.offset + n * slog_block_bytes(first.header), {}};
  source.read(block.offset, &block.header, sizeof block.header);
  if (!slog_header_intact(block.header) ||
      block.header.first_row != first.header.first_row + n * first.header.rows ||
      block.header.rows != first.header.rows || block.header.cols != first.header.cols)
    fail_format(source.path(), "",
                "the block at byte {} was changed while the log was read; use 'stageid log "
                "recover' to copy the intact parts",
                block.offset);
  return block;
}

/// Assigns the blocks of one scan, in order, to their runs.
class SlogIndexer::Step {
 public:
  Step(SlogIndexer& indexer, const SlogSource& source, const SlogScan& scan)
      : source_(source),
        scan_(scan),
        indexer_(indexer),
        index_(indexer.index_),
        next_damage_(scan.damage.begin()) {
    index_.damage.insert(index_.damage.end(), scan.damage.begin(), scan.damage.end());
    index_.log_id = scan.log_id;
    index_.blocks += scan.blocks.size();
  }

  void run() {
    if (!std::exchange(indexer_.has_info_, true)) read_info();
    for (const SlogBlock& block : scan_.blocks) {
      if (passes_damage(block)) close_run();
      try {
        take(block);
      } catch (const std::invalid_argument& error) {
        book_damage(block, error.what());
      } catch (const FormatError&) {  // damaged payload: the scan checked the headers only
        book_damage(block, "its payload is damaged");
      }
    }
    if (!scan_.blocks.empty()) index_.next_sequence = scan_.blocks.back().header.sequence + 1;
    std::stable_sort(index_.damage.begin(), index_.damage.end(),
                     [](const LogDamage& a, const LogDamage& b) { return a.offset < b.offset; });
  }

 private:
  /// Reads the first intact copy of the description; all copies are equal.
  void read_info() {
    for (const SlogBlock& block : scan_.blocks) {
      if (!block.header.is(SlogBlockType::log) || !payload_intact(source_, block)) continue;
      try {
        index_.info = parse_log_info(read_text(source_, block));
        return;
      } catch (const std::invalid_argument& error) {
        throw FormatError(source_.path(), "", error.what());
      }
    }
    throw FormatError(source_.path(), "",
                      "the description of the log (channels, sample rate) is missing or damaged; "
                      "the log cannot be read");
  }

  void book_damage(const SlogBlock& block, const std::string& wrong) {
    index_.damage.push_back(
        {block.offset, slog_block_bytes(block.header), describe(block) + ": " + wrong});
    close_run();
  }

  /// True if there is damage between the last block and this one.
  bool passes_damage(const SlogBlock& block) {
    const auto last = next_damage_;
    while (next_damage_ != scan_.damage.end() && next_damage_->offset <= block.offset)
      ++next_damage_;
    return next_damage_ != last;
  }

  void take(const SlogBlock& block) {
    index_.end.reset();  // only the very last block counts as the end
    const bool within_run = block.header.is(SlogBlockType::excitation) ||
                            block.header.is(SlogBlockType::samples) ||
                            block.header.is(SlogBlockType::run_end);
    if (within_run && !indexer_.open_ && !index_.damage.empty()) return;  // reported already
    switch (static_cast<SlogBlockType>(block.header.type)) {
      case SlogBlockType::log:
        if (!same_measurement(parse_log_info(read_text(source_, block)), index_.info))
          throw std::invalid_argument(
              "describes a different measurement than the first description");
        return;
      case SlogBlockType::run_begin:
        return begin_run(block);
      case SlogBlockType::excitation:
        return take_excitation(block);
      case SlogBlockType::samples:
        return take_samples(block);
      case SlogBlockType::run_end:
        return end_run(block);
      case SlogBlockType::end:
        close_run();
        index_.end = parse_end(read_text(source_, block));
        return;
    }
    fail_request("has the unknown type {}", block.header.type);
  }

  void begin_run(const SlogBlock& block) {
    close_run();
    SlogRunBegin begin = parse_run_begin(read_text(source_, block));
    check_run_begin(begin, index_.info);
    if (block.header.run < index_.runs.size())
      fail_request("is a duplicate start of run {}", slog_run_name(block.header.run));
    SlogRunIndex run;
    run.run = begin;
    run.run.name = slog_run_name(block.header.run);
    run.run.complete = false;
    run.excitation_columns = std::move(begin.excitation_columns);
    index_.runs.push_back(std::move(run));
    indexer_.number_ = block.header.run;
    indexer_.open_ = true;
  }

  SlogRunIndex& open_run(const SlogBlock& block) {
    if (!indexer_.open_ || block.header.run != indexer_.number_)
      fail_request("belongs to run {}, which is not open", slog_run_name(block.header.run));
    return index_.runs.back();
  }

  void take_excitation(const SlogBlock& block) {
    SlogRunIndex& run = open_run(block);
    const SlogBlockHeader& header = block.header;
    if (run.excitation || !run.samples.empty() ||
        !is_slog_excitation(header, index_.info, run.excitation_columns)) {
      throw std::invalid_argument("does not match the start of the run");
    }
    run.excitation = block;
  }

  void take_samples(const SlogBlock& block) {
    SlogRunIndex& run = open_run(block);
    const SlogBlockHeader& header = block.header;
    if (!are_slog_samples(header, index_.info))
      throw std::invalid_argument(
          "has a different number of words per row than the log has channels");
    if (header.first_row != run.run.samples)
      fail_request("starts with row {}; expected row {}", header.first_row, run.run.samples);
    run.run.samples += header.rows;
    if (!run.samples.empty() && run.samples.back().is_continued_by(block))
      ++run.samples.back().blocks;
    else
      run.samples.push_back({block});
  }

  void end_run(const SlogBlock& block) {
    SlogRunIndex& run = open_run(block);
    const LogRun end = parse_run_end(read_text(source_, block));
    if (end.samples != run.run.samples || end.realization != run.run.realization ||
        end.experiment != run.run.experiment)
      fail_request("ends a run of {} rows; {} were written", end.samples, run.run.samples);
    if (end.complete && !run.excitation && !run.excitation_columns.empty())
      throw std::invalid_argument("the run's excitation is missing");
    run.run.complete = end.complete;
    run.run.health = end.health;
    run.run.timing = end.timing;
    run.ended = true;
    close_run();
  }

  void close_run() noexcept { indexer_.open_ = false; }

  const SlogSource& source_;
  const SlogScan& scan_;
  SlogIndexer& indexer_;
  SlogIndex& index_;
  std::vector<LogDamage>::const_iterator next_damage_;
};

void check_run_begin(const SlogRunBegin& begin, const LogInfo& info) {
  const std::vector<int>& columns = begin.excitation_columns;
  const bool increasing =
      std::adjacent_find(columns.begin(), columns.end(), std::greater_equal<>()) == columns.end();
  if (!increasing ||
      (!columns.empty() &&
       (columns.front() < 0 || static_cast<std::size_t>(columns.back()) >= info.excitation.size())))
    throw std::invalid_argument("contains unknown excitation channels");
}

bool is_slog_excitation(const SlogBlockHeader& header, const LogInfo& info,
                        const std::vector<int>& columns) noexcept {
  return header.rows == static_cast<std::uint32_t>(info.period_samples) &&
         header.cols == columns.size() && has_its_bytes(header);
}

bool are_slog_samples(const SlogBlockHeader& header, const LogInfo& info) noexcept {
  return header.cols == slog_row_words(info) && header.rows > 0 && has_its_bytes(header);
}

void SlogIndexer::take(const SlogSource& source, const SlogScan& scan) {
  Step(*this, source, scan).run();
}

SlogIndex index_slog(const SlogSource& source, const SlogScan& scan) {
  SlogIndexer indexer;
  indexer.take(source, scan);
  return indexer.index();
}

std::uint32_t slog_row_words(const LogInfo& info) noexcept {
  return static_cast<std::uint32_t>(info.actuators.size() + info.sensors.size() +
                                    (info.stamps ? 2 : 1));
}

std::string slog_run_name(std::size_t index) { return fmt::format("{:04}", index); }

Eigen::MatrixXd read_slog_excitation(const SlogSource& source, const LogInfo& info,
                                     const SlogRunIndex& run) {
  if (!run.excitation && !run.excitation_columns.empty())
    fail_format(source.path(), "", "the excitation of run {} is missing; exclude this run",
                run.run.name);
  Eigen::MatrixXd excitation =
      Eigen::MatrixXd::Zero(info.period_samples, static_cast<Eigen::Index>(info.excitation.size()));
  if (!run.excitation) return excitation;
  const std::vector<std::byte> payload = read_payload(source, *run.excitation);
  const std::size_t column_bytes = sizeof(double) * static_cast<std::size_t>(info.period_samples);
  for (std::size_t k = 0; k < run.excitation_columns.size(); ++k)
    std::memcpy(excitation.col(run.excitation_columns[k]).data(), payload.data() + k * column_bytes,
                column_bytes);
  if (!excitation.allFinite())
    fail_format(source.path(), "", "the excitation of run {} contains a non-finite value",
                run.run.name);
  return excitation;
}

}  // namespace stageid
