#include "acquisition/slog/slog_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <random>
#include <thread>

#include "acquisition/files/file_error.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/row_transpose.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/acquisition/record/small_log.hpp"

namespace stageid::test_slog_reader {

using test::expect_error;

TEST(SlogStatus, PacksAndUnpacks) {
  const SampleStatus status{9, true, 0xFEDCBA98U};
  EXPECT_EQ(pack_status(status), 0xFEDCBA9800000109U);
  EXPECT_EQ(unpack_status(pack_status(status)), status);
  EXPECT_EQ(unpack_status(0), SampleStatus{});
}

using SlogReaderTest = test::SmallLogTest;

TEST_F(SlogReaderTest, GivesEveryRangeOfRows) {
  for (const std::uint64_t block_rows : {1U, 7U, 10U, 36U}) {
    const auto file = directory_ / ("a" + std::to_string(block_rows));
    test::write_small_log(file, 2, block_rows);
    const SlogReader reader(file);
    LogSamples samples;
    for (std::uint64_t first = 0; first <= 36; ++first) {
      for (std::uint64_t count = 0; count <= 36 - first; ++count) {
        reader.read(1, first, count, samples);
        ASSERT_EQ(samples.marked.size(), static_cast<Eigen::Index>(count));
        ASSERT_TRUE(test::holds_rows(samples, 1, first)) << first << " + " << count;
      }
    }
  }
}

// Blocks larger than the reader's piece, to cover pieces, tiles and padding.
TEST_F(SlogReaderTest, GivesRowsOfLargeBlocks) {
  constexpr std::uint64_t kRows = 12 * 1751;
  create([](SlogWriter& log) { test::write_run(log, 2, kRows, 9001); });
  const SlogReader reader(file_);
  std::mt19937_64 engine(5);
  LogSamples samples;
  for (int i = 0; i < 50; ++i) {
    const std::uint64_t first = engine() % kRows;
    const std::uint64_t count = engine() % (kRows - first + 1);
    reader.read(0, first, count, samples);
    ASSERT_TRUE(test::holds_rows(samples, 2, first)) << first << " + " << count;
  }
}

TEST_F(SlogReaderTest, DoesNotAllocateAnewForTheSameSize) {
  test::write_small_log(file_);
  const SlogReader reader(file_);
  LogSamples samples;
  reader.read(0, 0, 12, samples);
  const double* const before = samples.actuators.data();
  reader.read(1, 12, 12, samples);
  EXPECT_EQ(samples.actuators.data(), before);
}

TEST_F(SlogReaderTest, SeveralThreadsReadAtOnce) {
  constexpr std::uint64_t kRows = 12 * 400;
  create([](SlogWriter& log) {
    for (std::size_t run = 0; run < 4; ++run) test::write_run(log, run, kRows, 1000);
  });
  const SlogReader reader(file_);
  std::vector<int> good(4, 0);
  std::vector<std::thread> threads;
  for (std::size_t run = 0; run < 4; ++run) {
    threads.emplace_back([&, run] {
      LogSamples samples;
      for (std::uint64_t first = 0; first < kRows; first += 600) {
        reader.read(run, first, 600, samples);
        good[run] += test::holds_rows(samples, run, first) ? 1 : 0;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_THAT(good, testing::Each(8));
}

TEST_F(SlogReaderTest, UpdatesWhileTheLogIsBeingWritten) {
  test::write_small_log(file_, 3, 9);
  const std::string whole = test::read_bytes(file_);
  const std::size_t first = SlogSource(file_).bytes() / 10;  // with the description
  test::write_bytes(file_, whole.substr(0, first));
  SlogReader growing(file_, false);
  for (std::size_t bytes = first; bytes <= whole.size(); bytes += 7) {
    if (whole.size() - bytes < 7) bytes = whole.size();
    std::ofstream(file_, std::ios::app | std::ios::binary) << whole.substr(
        std::filesystem::file_size(file_), bytes - std::filesystem::file_size(file_));
    growing.update();
    const SlogReader anew(file_, false);
    ASSERT_EQ(growing.runs().size(), anew.runs().size());
    ASSERT_EQ(growing.damage().size(), anew.damage().size());
    ASSERT_EQ(growing.intact_blocks(), anew.intact_blocks());
    ASSERT_EQ(growing.end().has_value(), anew.end().has_value());
    for (std::size_t run = 0; run < anew.runs().size(); ++run)
      ASSERT_EQ(growing.runs()[run].complete, anew.runs()[run].complete);
    ASSERT_EQ(test::good_rows(growing), test::good_rows(anew));
  }
  EXPECT_EQ(growing.end()->message, "done");
  EXPECT_EQ(test::good_rows(growing), 3U * 36);
}

TEST_F(SlogReaderTest, RefusesRangesOutsideARun) {
  test::write_small_log(file_);
  const SlogReader reader(file_);
  LogSamples samples;
  EXPECT_THROW(reader.read(2, 0, 1, samples), std::invalid_argument);
  EXPECT_THROW(reader.read(0, 36, 1, samples), std::invalid_argument);
  EXPECT_THROW(reader.read(0, 1, ~std::uint64_t{0}, samples), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(reader.excitation(2)), std::invalid_argument);
}

TEST_F(SlogReaderTest, NamesTheChannelOfAValueThatIsNotFinite) {
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity()}) {
    std::filesystem::remove(file_);
    std::vector<double> rows = test::rows_of(0, 0, 36);
    rows[17 * 6 + 4] = value;  // sensor s2
    create([&](SlogWriter& log) {
      log.begin_run(test::run_of(0), test::excitation_of(0));
      log.write(rows);
      log.end_run(test::run_of(0));
    });
    const SlogReader reader(file_);
    LogSamples samples;
    expect_error<FormatError>([&] { reader.read(0, 12, 24, samples); },
                              file_.string() + ":/runs/0000: row 17", "'s2'");
    EXPECT_NO_THROW(reader.read(0, 0, 17, samples));
  }
}

TEST_F(SlogReaderTest, RefusesCompleteRunsOfNoWholePeriods) {
  /// Reads one run of `rows` rows, marked complete.
  const auto read = [&](std::uint64_t rows) {
    std::filesystem::remove(file_);
    create([&](SlogWriter& log) { test::write_run(log, 0, rows); });
    const SlogReader reader(file_);
  };
  expect_error<FormatError>([&] { read(35); }, file_.string() + ":/runs/0000", "35 samples");
  EXPECT_THROW(read(12), FormatError) << "transient only";
  EXPECT_THROW(read(0), FormatError);
  EXPECT_NO_THROW(read(24));
}

TEST_F(SlogReaderTest, RefusesTheSameCompleteRunTwice) {
  create([](SlogWriter& log) {
    test::write_run(log, 1);
    test::write_run(log, 1);
  });
  expect_error<FormatError>([&] { SlogReader{file_}; }, file_, "duplicate realization");
}

TEST_F(SlogReaderTest, SaysThatALogWasNotClosed) {
  {
    SlogWriter log = create();
    test::write_run(log, 0);
    log.begin_run(test::run_of(1), test::excitation_of(1));
    log.write(test::rows_of(1, 0, 10));
  }
  expect_error<FormatError>([&] { open_log(file_); }, file_, "stageid log recover");
  const auto reader = open_log(file_, false);
  ASSERT_EQ(reader->runs().size(), 2U);
  EXPECT_TRUE(reader->runs()[0].complete);
  EXPECT_FALSE(reader->runs()[1].complete);
  EXPECT_EQ(reader->runs()[1].samples, 10U);
}

using OpenLog = test::SmallLogTest;

TEST_F(OpenLog, SaysWhatAFileIsNot) {
  EXPECT_THROW(open_log(directory_ / "none"), FileError);
  EXPECT_THROW(open_log(directory_.path()), FileError);
  test::write_bytes(file_, "");
  expect_error<FormatError>([&] { open_log(file_); }, file_, "is empty");
  test::write_bytes(file_, "time,u,y\n");
  expect_error<FormatError>([&] { open_log(file_); }, file_, "neither");
}

TEST(RowTranspose, MovesEveryValueAndSeesEveryNonFiniteOne) {
  for (const std::size_t count : {1U, 7U, 8U, 63U, 64U, 65U, 200U}) {
    for (const std::size_t columns : {1U, 3U, 8U, 17U, 24U}) {
      const std::size_t words = columns + 1;
      std::vector<double> rows(count * words);
      for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<double>(i);
      // The word after the columns is not a number and must be ignored.
      for (std::size_t r = 0; r < count; ++r)
        rows[r * words + columns] = std::numeric_limits<double>::quiet_NaN();
      const std::size_t stride = count + 3;
      std::vector<double> out(columns * stride, -1.0);
      ASSERT_TRUE(transpose_rows(rows.data(), words, count, columns, out.data(), stride));
      for (std::size_t c = 0; c < columns; ++c) {
        for (std::size_t r = 0; r < stride; ++r) {
          const double expected = r < count ? rows[r * words + c] : -1.0;
          ASSERT_EQ(out[c * stride + r], expected);
        }
      }
      for (std::size_t i = 0; i < count * columns; i += 5) {
        double& value = rows[i / columns * words + i % columns];
        const double before = value;
        value = std::numeric_limits<double>::infinity();
        ASSERT_FALSE(transpose_rows(rows.data(), words, count, columns, out.data(), stride));
        value = before;
      }
    }
  }
}

using SlogFormat = test::SmallLogTest;

// The numpy code in docs/formats.md is meant to be copied.
TEST_F(SlogFormat, TheNumpyLinesOfTheDocumentReadALog) {
  if (std::system("/usr/bin/python3 -c 'import numpy' 2> /dev/null") != 0)
    GTEST_SKIP() << "needs python3 with numpy";
  test::write_small_log(directory_ / "run.slog", 2, 10);
  std::ifstream document(std::string(STAGEID_SOURCE_DIR) + "/docs/formats.md");
  std::ofstream script(directory_ / "read.py");
  std::string line;
  while (std::getline(document, line) && line != "import numpy as np") {
  }
  for (; document && line != "```"; std::getline(document, line)) script << line << '\n';
  script << "for run in (0, 1):\n"
            "  n = np.arange(36)\n"
            "  assert samples[run].shape == (36, 6)\n"
            "  for c in range(3):\n"
            "    assert (samples[run][:, c] == 1000 * run + n + 0.125 * (c + 1)).all()\n"
            "  marked = samples[run][:, 5].copy().view('<u8') >> 8 & 1\n"
            "  assert (marked == ((n + run) % 7 == 3)).all()\n";
  script.close();
  const std::string command = "cd " + directory_.path().string() + " && /usr/bin/python3 read.py";
  EXPECT_EQ(std::system(command.c_str()), 0);
}

}  // namespace stageid::test_slog_reader
