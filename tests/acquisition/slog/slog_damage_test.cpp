#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <optional>

#include "acquisition/files/file_error.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "acquisition/slog/slog_recover.hpp"
#include "tests/acquisition/record/small_log.hpp"

namespace stageid::test_slog_damage {

/// The whole content of a log, or nothing if it is refused.
std::optional<std::string> content(const std::filesystem::path& file) {
  try {
    const auto reader = open_log(file);
    std::string all = reader->info().metadata_json;
    LogSamples samples;
    for (std::size_t run = 0; run < reader->runs().size(); ++run) {
      const LogRun& which = reader->runs()[run];
      all += which.started_utc + std::to_string(which.realization) +
             std::to_string(which.experiment) + std::to_string(which.complete);
      const auto add = [&](const auto& values) {
        all.append(reinterpret_cast<const char*>(values.data()),
                   static_cast<std::size_t>(values.size()) * sizeof *values.data());
      };
      add(reader->excitation(run));
      reader->read(run, 0, which.samples, samples);
      add(samples.actuators);
      add(samples.sensors);
      add(samples.marked);
    }
    return all;
  } catch (const FormatError&) {
    return std::nullopt;
  }
}

using SlogDamage = test::SmallLogTest;

TEST_F(SlogDamage, ALogWithoutItsFirstBlockOnTheDiskIsUnwritten) {
  SlogWriter::create(file_, test::small_info());
  const std::string first = test::read_bytes(file_);
  const auto is_unwritten = [&](const std::string& bytes) {
    test::write_bytes(file_, bytes);
    return is_unwritten_slog(file_);
  };
  EXPECT_FALSE(is_unwritten(first));
  for (std::size_t size = 0; size < first.size(); ++size)
    ASSERT_TRUE(is_unwritten(first.substr(0, size))) << size;
  for (std::size_t zeros = 8; zeros <= first.size(); zeros += 8)
    ASSERT_TRUE(is_unwritten(std::string(zeros, '\0') + first.substr(zeros))) << zeros;

  EXPECT_FALSE(is_unwritten("a text")) << "shorter than a mark, but no part of one";
  EXPECT_FALSE(is_unwritten("notes on the stage, longer than a header of a block of a native log"));
  std::string later = first;
  later[10] = 2;  // the version; its header has another checksum
  SlogBlockHeader header;
  std::memcpy(&header, later.data(), sizeof header);
  header.header_crc = slog_header_crc(header);
  std::memcpy(later.data(), &header, sizeof header);
  EXPECT_FALSE(is_unwritten(later)) << "of a later version";
  std::filesystem::remove(file_);
  test::write_small_log(file_, 2, 18);
  std::string log = test::read_bytes(file_);
  std::fill_n(log.begin(), 64, '\0');
  EXPECT_FALSE(is_unwritten(log)) << "what follows the first block is intact";
}

TEST_F(SlogDamage, EveryFlippedByteIsAnError) {
  test::write_small_log(file_, 2, 18);
  const std::string good = test::read_bytes(file_);
  ASSERT_TRUE(content(file_).has_value());
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string bad = good;
    bad[at] ^= static_cast<char>(1U << (at % 8));
    test::write_bytes(file_, bad);
    ASSERT_FALSE(content(file_).has_value()) << "byte " << at << " of " << good.size();
    if (at % 37 == 0) {
      const bool intact = [&] {
        try {
          return verify_log(file_).intact();
        } catch (const FormatError&) {
          return false;
        }
      }();
      ASSERT_FALSE(intact) << "byte " << at;
    }
  }
}

TEST_F(SlogDamage, EveryTruncationIsAnErrorAndItsIntactRowsAreGiven) {
  test::write_small_log(file_, 2, 9);
  const std::string good = test::read_bytes(file_);
  std::uint64_t rows_before = 0;
  for (std::size_t size = 0; size < good.size(); ++size) {
    test::write_bytes(file_, good.substr(0, size));
    ASSERT_THROW(open_log(file_), FormatError) << size;
    if (size == 0) continue;
    std::unique_ptr<LogReader> reader;
    try {
      reader = open_log(file_, false);
    } catch (const FormatError&) {
      ASSERT_EQ(rows_before, 0U) << "byte " << size << ": what was there is gone";
      continue;
    }
    const std::uint64_t rows = test::good_rows(*reader);
    ASSERT_GE(rows, rows_before);
    rows_before = rows;
  }
  EXPECT_EQ(rows_before, 72U);
}

// The following tests cover failures of the disk, not of a process: the log is cut at any length, then resumed.
TEST_F(SlogDamage, EveryTruncationCanBeResumed) {
  test::write_small_log(file_, 1, 9);
  const std::string good = test::read_bytes(file_);
  SlogBlockHeader first;
  std::memcpy(&first, good.data(), sizeof first);
  for (std::size_t size = slog_block_bytes(first); size < good.size(); size += 13) {
    test::write_bytes(file_, good.substr(0, size));
    bool complete_before = false;
    {
      const auto reader = open_log(file_, false);
      complete_before = !reader->runs().empty() && reader->runs()[0].complete;
    }
    {
      SlogWriter log = resume();
      if (!complete_before) test::write_run(log, 0);
      log.close(0, "");
    }
    const SlogReader reader(file_);
    const LogRun& last = reader.runs().back();
    ASSERT_TRUE(last.complete);
    LogSamples samples;
    reader.read(reader.runs().size() - 1, 0, last.samples, samples);
    ASSERT_TRUE(test::holds_rows(samples, 0, 0));
  }
}

TEST_F(SlogDamage, BlocksOfAnotherLogAreNotTaken) {
  test::write_small_log(file_);
  test::write_small_log(directory_ / "b.slog");
  const std::string a = test::read_bytes(file_);
  const std::string b = test::read_bytes(directory_ / "b.slog");
  ASSERT_EQ(a.size(), b.size());
  // As after a power failure: the second half was never written and contains an older file.
  SlogSource source(file_);
  const std::uint64_t cut = scan_slog(source, SlogScanDepth::headers).blocks[6].offset;
  test::write_bytes(directory_ / "c.slog", a.substr(0, cut) + b.substr(cut));
  EXPECT_THROW(open_log(directory_ / "c.slog"), FormatError);
  EXPECT_LT(open_log(directory_ / "c.slog", false)->runs()[0].samples, 36U);
}

TEST_F(SlogDamage, AMissingBlockIsNoticedThoughAllOthersAreIntact) {
  test::write_small_log(file_, 2, 9);
  const std::string good = test::read_bytes(file_);
  const std::vector<SlogBlock> blocks = [&] {
    return scan_slog(SlogSource(file_), SlogScanDepth::headers).blocks;
  }();
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    test::write_bytes(file_, good.substr(0, blocks[k].offset) + good.substr(blocks[k].end()));
    EXPECT_THROW(open_log(file_), FormatError) << describe(blocks[k]);
  }
}

TEST_F(SlogDamage, AScanInStepsFindsTheSame) {
  test::write_small_log(file_, 2, 9);
  const std::string good = test::read_bytes(file_);
  const SlogScan intact = scan_slog(SlogSource(file_), SlogScanDepth::payloads);
  const auto agrees = [&](const std::string& bytes) {
    test::write_bytes(file_, bytes);
    const SlogSource source(file_);
    const SlogScan whole = scan_slog(source, SlogScanDepth::payloads);
    for (const std::size_t most : {4U, 5U, 9U}) {
      SlogScanner scanner(SlogScanDepth::payloads);
      std::vector<std::uint64_t> offsets;
      std::size_t damage = 0;
      while (!scanner.is_at_end(source)) {
        const SlogScan step = scanner.next(source, most);
        for (const SlogBlock& block : step.blocks) offsets.push_back(block.offset);
        damage += step.damage.size();
      }
      EXPECT_EQ(damage + (scanner.tail() ? 1U : 0U), whole.damage.size());
      ASSERT_EQ(offsets.size(), whole.blocks.size());
      for (std::size_t k = 0; k < offsets.size(); ++k)
        EXPECT_EQ(offsets[k], whole.blocks[k].offset);
    }
  };
  agrees(good);
  const SlogBlock& late = intact.blocks[intact.blocks.size() - 3];
  for (const SlogBlock& block : intact.blocks) {
    std::string flipped = good;
    flipped[block.offset + 70] ^= 1;
    agrees(flipped);
    agrees(good.substr(0, block.offset) + good.substr(block.end()));  // missing
    agrees(good.substr(0, block.offset) + good.substr(late.offset, slog_block_bytes(late.header)) +
           good.substr(block.offset));
    agrees(good.substr(0, block.end() + 30));
  }
}

// Recover ------------------------------------------------------------------------------------

struct SlogRecover : test::SmallLogTest {
  void SetUp() override {
    test::write_small_log(file_, 3, 9);
    good_ = test::read_bytes(file_);
    blocks_ = scan_slog(SlogSource(file_), SlogScanDepth::headers).blocks;
  }

  /// Index of the `nth` block of a type.
  std::size_t block(SlogBlockType type, int nth) const {
    for (std::size_t k = 0; k < blocks_.size(); ++k) {
      if (blocks_[k].header.is(type) && nth-- == 0) return k;
    }
    return blocks_.size();
  }

  RecoverReport recover(const std::string& bytes) {
    test::write_bytes(file_, bytes);
    return recover_log(file_, directory_ / "out.slog");
  }

  std::string with_damage(std::size_t block, std::uint64_t at) const {
    std::string bytes = good_;
    bytes[blocks_[block].offset + at] ^= 0x10;
    return bytes;
  }

  std::filesystem::path out_ = directory_ / "out.slog";
  std::string good_;
  std::vector<SlogBlock> blocks_;
};

TEST_F(SlogRecover, AnIntactLogIsCopiedWhole) {
  const RecoverReport report = recover(good_);
  EXPECT_EQ(report.blocks_kept, blocks_.size());
  EXPECT_EQ(report.blocks_lost, 0U);
  EXPECT_EQ(report.rows_kept, 3U * 36);
  EXPECT_EQ(report.rows_lost, 0U);
  EXPECT_EQ(report.complete_runs, 3);
  EXPECT_TRUE(report.damage.empty());
  EXPECT_EQ(content(out_), content(file_));
  EXPECT_EQ(test::read_bytes(file_), good_);
}

TEST_F(SlogRecover, RowsLostInTheMiddleBecomeMarkedRows) {
  const std::size_t damaged = block(SlogBlockType::samples, 5);             // run 1, rows 9 to 17
  for (const std::uint64_t at : {std::uint64_t{20}, std::uint64_t{100}}) {  // header, payload
    const RecoverReport report = recover(with_damage(damaged, at));
    EXPECT_EQ(report.blocks_lost, 1U);
    EXPECT_EQ(report.rows_lost, 9U);
    EXPECT_EQ(report.rows_kept, 3U * 36 - 9);
    EXPECT_EQ(report.complete_runs, 3);
    ASSERT_EQ(report.damage.size(), 1U);
    EXPECT_EQ(report.damage[0].offset, blocks_[damaged].offset);

    const SlogReader reader(out_);
    LogSamples samples;
    reader.read(1, 0, 9, samples);
    EXPECT_TRUE(test::holds_rows(samples, 1, 0));
    reader.read(1, 9, 9, samples);
    EXPECT_TRUE((samples.marked == 1).all());
    EXPECT_TRUE(samples.actuators.isZero(0.0) && samples.sensors.isZero(0.0));
    reader.read(1, 18, 18, samples);
    EXPECT_TRUE(test::holds_rows(samples, 1, 18));
    EXPECT_EQ(reader.runs()[1].health.marked, test::run_of(1).health.marked + 9);
    for (const std::size_t run : {0U, 1U, 2U})
      EXPECT_EQ(reader.runs()[run].health.lost, run == 1 ? 9U : 0U);
  }
}

TEST_F(SlogRecover, ARunThatLostRowsIsReplacedByItsRepetition) {
  recover(with_damage(block(SlogBlockType::samples, 5), 100));  // in run 1
  SlogWriter log = SlogWriter::resume(out_, test::small_info());
  log.begin_run(test::run_of(1), test::excitation_of(1));
  log.write(test::rows_of(1, 0, 36));
  log.end_run(test::run_of(1));
  log.close(0, "");
  const SlogReader reader(out_);
  ASSERT_EQ(reader.runs().size(), 4U);
  EXPECT_TRUE(reader.runs()[0].complete && !reader.runs()[1].complete);
  EXPECT_TRUE(reader.runs()[2].complete && reader.runs()[3].complete);
}

TEST_F(SlogRecover, EverySingleDamagedBlockLeavesAllOthers) {
  for (std::size_t damaged = 0; damaged < blocks_.size(); ++damaged) {
    const RecoverReport report = recover(with_damage(damaged, 70));
    // An excitation without its run_begin is lost, because its columns are unknown.
    const std::size_t lost = blocks_[damaged].header.is(SlogBlockType::run_begin) ? 2 : 1;
    EXPECT_EQ(report.blocks_kept, blocks_.size() - lost) << describe(blocks_[damaged]);
    EXPECT_EQ(report.blocks_lost, lost);
    const SlogReader reader(out_);  // the new log is intact in any case
    EXPECT_TRUE(verify_log(out_).intact());
    const bool rows_lost = blocks_[damaged].header.is(SlogBlockType::samples);
    EXPECT_EQ(report.rows_kept, 3U * 36 - (rows_lost ? blocks_[damaged].header.rows : 0U));
    const bool run_lost = blocks_[damaged].header.is(SlogBlockType::run_begin) ||
                          blocks_[damaged].header.is(SlogBlockType::excitation) ||
                          blocks_[damaged].header.is(SlogBlockType::run_end);
    EXPECT_EQ(report.complete_runs, run_lost ? 2 : 3) << describe(blocks_[damaged]);
  }
}

TEST_F(SlogRecover, FindsTheBlocksBehindInsertedAndDeletedBytes) {
  const std::size_t damaged = block(SlogBlockType::samples, 2);
  const std::uint64_t at = blocks_[damaged].offset + 80;
  for (const std::string& bytes : {good_.substr(0, at) + "12345" + good_.substr(at),
                                   good_.substr(0, at) + good_.substr(at + 7)}) {
    const RecoverReport report = recover(bytes);
    EXPECT_EQ(report.blocks_kept, blocks_.size() - 1);
    EXPECT_EQ(report.rows_lost, blocks_[damaged].header.rows);
    EXPECT_EQ(report.complete_runs, 3);
    EXPECT_TRUE(content(out_).has_value());
  }
}

TEST_F(SlogRecover, ALogCutAtAnyByteGivesItsWholeBlocks) {
  for (std::size_t size = slog_block_bytes(blocks_[0].header); size < good_.size(); size += 41) {
    const RecoverReport report = recover(good_.substr(0, size));
    std::uint64_t whole = 0;
    for (const SlogBlock& b : blocks_) whole += b.end() <= size ? 1U : 0U;
    ASSERT_EQ(report.blocks_kept, whole);
    ASSERT_EQ(report.rows_lost, 0U) << "nobody knows how many would have followed";
    ASSERT_TRUE(verify_log(out_).intact());
    ASSERT_EQ(verify_log(out_).exit_code, 1);
  }
}

TEST_F(SlogRecover, RefusesWhatItCannotSave) {
  EXPECT_THROW(recover_log(file_, file_), std::invalid_argument);
  EXPECT_THROW(recover_log(directory_ / "none", out_), FileError);
  EXPECT_THROW(recover("not a log, but long enough to hold a header: "
                       "0123456789012345678901234567890123456789"),
               FormatError);
  EXPECT_FALSE(std::filesystem::exists(out_)) << "no partial output";
  // All three descriptions of the log are damaged: the first one and those of the runs.
  std::string bytes = good_;
  for (const SlogBlock& b : blocks_) {
    if (b.header.is(SlogBlockType::log)) bytes[b.offset + 70] ^= 1;
  }
  EXPECT_THROW(recover(bytes), FormatError);
  EXPECT_FALSE(std::filesystem::exists(out_));
}

TEST_F(SlogRecover, VerifyCountsAndNamesTheDamage) {
  VerifyReport report = verify_log(file_);
  EXPECT_TRUE(report.intact());
  EXPECT_EQ(report.bytes, good_.size());
  EXPECT_EQ(report.blocks, blocks_.size());
  EXPECT_EQ(report.rows, 108U);
  EXPECT_EQ(report.marked_rows, 15U);  // rows with (row + run) % 7 == 3: 5 of 36 in each run
  EXPECT_EQ(report.runs, 3);
  EXPECT_EQ(report.complete_runs, 3);
  EXPECT_EQ(report.exit_message, "done");

  const std::size_t damaged = block(SlogBlockType::samples, 5);
  test::write_bytes(file_, with_damage(damaged, 100));
  report = verify_log(file_);
  EXPECT_FALSE(report.intact());
  EXPECT_TRUE(report.closed);
  EXPECT_EQ(report.blocks, blocks_.size() - 1);
  ASSERT_FALSE(report.damage.empty());
  EXPECT_EQ(report.damage[0].offset, blocks_[damaged].offset);
  EXPECT_EQ(report.damage[0].bytes, slog_block_bytes(blocks_[damaged].header));
}

}  // namespace stageid::test_slog_damage
