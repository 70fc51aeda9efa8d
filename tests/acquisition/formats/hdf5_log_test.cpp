#include "acquisition/formats/hdf5_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "acquisition/files/file_error.hpp"
#include "acquisition/formats/open_log.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/acquisition/record/small_log.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_hdf5_log {

using test::excitation_of;
using test::expect_error;
using test::kPeriod;

using Shape = std::vector<hsize_t>;

constexpr std::uint64_t kRows = 3 * kPeriod;

using Values = std::vector<double>;  // row by row

/// value(run, row, column).
Values values_of(std::size_t run, std::uint64_t rows, int columns,
                 double (*value)(std::size_t, std::uint64_t, int)) {
  Values values;
  for (std::uint64_t n = 0; n < rows; ++n)
    for (int c = 0; c < columns; ++c) values.push_back(value(run, n, c));
  return values;
}

Values actuators(std::size_t run, std::uint64_t rows = kRows) {
  return values_of(run, rows, 3, test::actuator_value);
}

Values sensors(std::size_t run, std::uint64_t rows = kRows) {
  return values_of(run, rows, 2, test::sensor_value);
}

Values excitation(std::size_t run, std::uint64_t rows) {
  return values_of(run, rows, 3, [](std::size_t of, std::uint64_t n, int c) {
    return excitation_of(of)(static_cast<Eigen::Index>(n % kPeriod), c);
  });
}

using Id = std::pair<long long, long long>;  // realization, experiment

/// A log of another program. Every part can be omitted or replaced.
struct Foreign {
  std::string format = "stageid-log";
  long long version = 1;
  double sample_rate_hz = 1000.0;
  long long period_samples = kPeriod;
  long long transient_periods = 1;
  std::vector<std::string> sensor_units = {"m"};
  std::string left_out = {};  ///< object that is not written
  std::vector<Id> ids = {{0, 0}, {0, 1}};
  bool whole_excitation = false;
  /// Called last, with the open file.
  std::function<void(Hdf5File&)> change = [](Hdf5File&) {};
};

struct Hdf5Log : testing::Test {
  void write(const Foreign& foreign) {
    std::filesystem::remove(path_);
    Hdf5File file = Hdf5File::create(path_);
    file.write_attribute("/", "format", foreign.format);
    file.write_attribute("/", "format_version", foreign.version);
    file.write_attribute("/", "sample_rate_hz", foreign.sample_rate_hz);
    if (foreign.left_out != "period_samples")
      file.write_attribute("/", "period_samples", foreign.period_samples);
    file.write_attribute("/", "transient_periods", foreign.transient_periods);
    file.create_group("/channels");
    const LogInfo info = test::small_info();
    file.write_texts("/channels/excitation", info.excitation.names);
    file.write_attribute("/channels/excitation", "unit", std::string("N"));
    file.write_texts("/channels/actuators", info.actuators.names);
    file.write_attribute("/channels/actuators", "unit", info.actuators.units);
    if (foreign.left_out != "/channels/sensors") {
      file.write_texts("/channels/sensors", info.sensors.names);
      file.write_attribute("/channels/sensors", "unit", foreign.sensor_units);
    }
    if (foreign.left_out != "/runs") write_runs(file, foreign);
    foreign.change(file);
    file.close();
  }

  static void write_runs(Hdf5File& file, const Foreign& foreign) {
    file.create_group("/runs");
    for (std::size_t run = 0; run < foreign.ids.size(); ++run) {
      const std::uint64_t rows = foreign.whole_excitation ? kRows : kPeriod;
      add_run(file, "/runs/000" + std::to_string(run), foreign.ids[run], excitation(run, rows),
              actuators(run), sensors(run), foreign.left_out);
    }
  }

  /// Adds a run without its datasets.
  static void add_run(Hdf5File& file, const std::string& group, Id id) {
    file.create_group(group);
    file.write_attribute(group, "realization", id.first);
    file.write_attribute(group, "experiment", id.second);
  }

  static void add_run(Hdf5File& file, const std::string& group, Id id, const Values& r,
                      const Values& u, const Values& y, const std::string& left_out = "") {
    add_run(file, group, id);
    const auto add = [&](const std::string& name, std::size_t columns, const Values& values) {
      const Shape shape = {values.size() / columns, columns};
      if (name != left_out) file.write_reals(group + "/" + name, shape, values.data());
    };
    add("excitation", 3, r);
    add("actuators", 3, u);
    add("sensors", 2, y);
  }

  LogSamples read(std::size_t run, std::uint64_t first, std::uint64_t count) const {
    LogSamples samples;
    open_log(path_)->read(run, first, count, samples);
    return samples;
  }

  void expect_refused(const Foreign& foreign, const std::string& place, const std::string& reason) {
    write(foreign);
    expect_error<FormatError>([&] { open_log(path_); }, path_.string() + ":" + place, reason);
  }

  test::TemporaryDirectory directory_;
  std::filesystem::path path_ = directory_ / "log.h5";
};

TEST_F(Hdf5Log, ReadsWhatAForeignProgramWrites) {
  write({});
  const auto reader = open_log(path_);
  EXPECT_TRUE(same_measurement(reader->info(), test::small_info()));
  ASSERT_EQ(reader->runs().size(), 2U);
  LogSamples samples;
  for (std::size_t run = 0; run < 2; ++run) {
    EXPECT_EQ(reader->runs()[run].samples, kRows);
    EXPECT_TRUE(reader->runs()[run].complete);
    EXPECT_EQ(reader->runs()[run].experiment, static_cast<int>(run));
    EXPECT_EQ(reader->excitation(run), excitation_of(run));
    for (std::uint64_t first = 0; first <= kRows; first += 5) {
      reader->read(run, first, kRows - first, samples);
      ASSERT_TRUE((samples.marked == 0).all());
      for (Eigen::Index r = 0; r < samples.marked.size(); ++r)
        samples.marked[r] = test::is_marked(run, first + static_cast<std::uint64_t>(r)) ? 1 : 0;
      ASSERT_TRUE(test::holds_rows(samples, run, first));
    }
  }
  EXPECT_THROW(reader->read(2, 0, 1, samples), std::invalid_argument);
  EXPECT_THROW(reader->read(0, 30, 7, samples), std::invalid_argument);
}

TEST_F(Hdf5Log, TakesOneUnitOrOneAChannel) {
  write({.sensor_units = {"m", "rad"}});
  EXPECT_EQ(open_log(path_)->info().sensors.units, (std::vector<std::string>{"m", "rad"}));
  expect_refused({.sensor_units = {"m", "rad", "m"}}, "/channels/sensors", "3 units");
}

// If all signals lose samples, the following periods are only displaced.
TEST_F(Hdf5Log, AWholeExcitationMayLackARow) {
  write({.change = [](Hdf5File& file) {
    Values values = excitation(2, kRows);
    const auto lost = values.begin() + 3 * (kPeriod + 2);
    values.erase(lost, lost + 3);
    values.insert(values.end(), {0.0, 0.0, 0.0});
    add_run(file, "/runs/0002", {1, 0}, values, actuators(2), sensors(2));
  }});
  EXPECT_EQ(open_log(path_)->excitation(2), excitation_of(2));
}

TEST_F(Hdf5Log, AWholeExcitationMustRepeat) {
  write({.whole_excitation = true});
  EXPECT_EQ(open_log(path_)->excitation(1), excitation_of(1));

  const auto with_error = [&](double error) {
    write({.change = [error](Hdf5File& file) {
      Values values = excitation(2, kRows);
      values[3 * 30 + 2] += error;
      add_run(file, "/runs/0002", {1, 0}, values, actuators(2), sensors(2));
    }});
    return open_log(path_)->excitation(2);
  };
  const double peak = excitation_of(2).cwiseAbs().maxCoeff();
  EXPECT_EQ(with_error(0.5e-9 * peak), excitation_of(2));
  expect_error<FormatError>([&] { with_error(2e-9 * peak); },
                            path_.string() + ":/runs/0002/excitation: is not periodic",
                            "row 30 of 'z3'");
  EXPECT_THROW(with_error(std::numeric_limits<double>::quiet_NaN()), FormatError);
}

TEST_F(Hdf5Log, IntegersAreScaled) {
  const Values scale = {0.5, 0.25, 2.0};
  const Values offset = {1.0, 0.0, -1.0};
  const auto change = [&](Hdf5File& file) {
    add_run(file, "/runs/0000", {0, 0});
    std::vector<long long> u(kRows * 3);
    std::vector<long long> y(kRows * 2);
    for (std::size_t i = 0; i < u.size(); ++i) u[i] = static_cast<long long>(i) - 50;
    for (std::size_t i = 0; i < y.size(); ++i) y[i] = 7 * static_cast<long long>(i);
    file.write_integers("/runs/0000/actuators", Shape{kRows, 3}, u.data());
    file.write_attribute("/runs/0000/actuators", "scale", scale);
    file.write_attribute("/runs/0000/actuators", "offset", offset);
    file.write_integers("/runs/0000/sensors", Shape{kRows, 2}, y.data());
    file.write_attribute("/runs/0000/sensors", "scale", 1e-9);
    file.write_reals("/runs/0000/excitation", Shape{kPeriod, 3}, excitation(0, kPeriod).data());
    file.write_attribute("/runs/0000/excitation", "offset", 0.5);
  };
  write({.ids = {}, .change = change});
  const LogSamples samples = read(0, 4, 10);
  for (Eigen::Index r = 0; r < 10; ++r) {
    for (Eigen::Index c = 0; c < 3; ++c) {
      const double stored = static_cast<double>((r + 4) * 3 + c - 50);
      EXPECT_DOUBLE_EQ(samples.actuators(r, c), scale[c] * stored + offset[c]);
    }
    EXPECT_DOUBLE_EQ(samples.sensors(r, 1), 1e-9 * 7 * static_cast<double>((r + 4) * 2 + 1));
  }
  EXPECT_EQ(open_log(path_)->excitation(0), Eigen::MatrixXd(excitation_of(0).array() + 0.5));
  for (const Values& bad : {Values{1.0, 2.0}, Values{1.0, std::nan(""), 1.0}}) {
    const auto spoil = [&](Hdf5File& file) {
      file.write_attribute("/runs/0001/actuators", "scale", bad);
    };
    expect_refused({.change = spoil}, "/runs/0001/actuators", "scale");
  }
}

TEST_F(Hdf5Log, MarkedSamplesAreGiven) {
  std::vector<long long> marked(kRows, 0);
  marked[3] = 1;
  marked[20] = 255;
  const auto with_marks = [&](std::uint64_t rows) {
    return Foreign{.change = [&marked, rows](Hdf5File& file) {
      file.write_integers("/runs/0001/marked", Shape{rows}, marked.data());
    }};
  };
  write(with_marks(kRows));
  const LogSamples samples = read(1, 2, 30);
  for (Eigen::Index r = 0; r < 30; ++r) EXPECT_EQ(samples.marked[r] != 0, r == 1 || r == 18);
  expect_refused(with_marks(kRows - 1), "/runs/0001/marked", "36");
}

TEST_F(Hdf5Log, RefusesWhatIsMissing) {
  expect_refused({.left_out = "period_samples"}, "/", "'period_samples' is missing");
  for (const char* part : {"/channels/sensors", "/runs"})
    expect_refused({.left_out = part}, part, "missing");
  for (const std::string part : {"excitation", "actuators", "sensors"})
    expect_refused({.left_out = part}, "/runs/0000/" + part, "missing");
}

TEST_F(Hdf5Log, RefusesAttributesThatMakeNoSense) {
  expect_refused({.format = "stageid-frf"}, "/", "is a frequency response, not a log;");
  expect_refused({.version = 2}, "/", "version 2");
  expect_refused({.sample_rate_hz = 0.0}, "/", "sample_rate_hz");
  expect_refused({.sample_rate_hz = std::nan("")}, "/", "sample_rate_hz");
  expect_refused({.period_samples = 0}, "/", "period_samples");
  expect_refused({.period_samples = -12}, "/", "period_samples");
  expect_refused({.period_samples = 1LL << 40}, "/", "period_samples");
  expect_refused({.period_samples = 2'000'000'000}, "/", "period_samples");
  expect_refused({.transient_periods = -1}, "/", "transient_periods");
}

TEST_F(Hdf5Log, RefusesRunsOfNoWholePeriods) {
  // 36 samples are three periods of 12, but not a whole number of 10 or 11, and not more than 3 transient ones.
  const auto change = [](Hdf5File& file) {
    file.write_reals("/runs/0000/excitation", Shape{7, 3}, excitation(0, 7).data());
  };
  expect_refused({.period_samples = 7, .left_out = "excitation", .ids = {{0, 0}}, .change = change},
                 "/runs/0000", "36 samples");
  expect_refused({.transient_periods = 3}, "/runs/0000", "36 samples");
  expect_refused({.transient_periods = 1LL << 30}, "/runs/0000", "36 samples");
}

TEST_F(Hdf5Log, RefusesWrongShapes) {
  const auto with = [&](const std::string& name, const Shape& shape, const std::string& reason) {
    const auto change = [&](Hdf5File& file) {
      const std::vector<double> values(1000, 1.0);
      file.write_reals("/runs/0000/" + name, shape, values.data());
    };
    expect_refused({.left_out = name, .ids = {{0, 0}}, .change = change}, "/runs/0000", reason);
  };
  with("sensors", {kRows, 3}, "[36 x 3]");
  with("sensors", {kRows}, "[36]");
  with("sensors", {kRows, 2, 1}, "[36 x 2 x 1]");
  with("sensors", {kRows - 1, 2}, "36 rows");
  with("actuators", {kRows, 2}, "samples x 3 channels");
  with("actuators", {3, kRows}, "samples x 3 channels");
  with("excitation", {kPeriod + 1, 3}, "13 rows");
  with("excitation", {kPeriod, 2}, "samples x 3 channels");
}

TEST_F(Hdf5Log, RefusesRunsThatCannotBe) {
  expect_refused({.ids = {{0, 0}, {0, 0}}}, "/runs/0001", "duplicate");
  expect_refused({.ids = {{0, 0}, {-1, 0}}}, "/runs/0001", "realization -1");
  expect_refused({.ids = {{0, 0}, {0, -2}}}, "/runs/0001", "experiment -2");
  expect_refused({.ids = {{0, 0}, {1LL << 33, 0}}}, "/runs/0001", "out of range");
}

TEST_F(Hdf5Log, ARunThatWasBrokenOffMayHaveAnyLength) {
  write({.change = [](Hdf5File& file) {
    // The same as run 0000, which is complete.
    add_run(file, "/runs/0002", {0, 0}, excitation(2, kPeriod), actuators(2, 5), sensors(2, 5));
    file.write_attribute("/runs/0002", "complete", 0LL);
    file.write_attribute("/runs/0002", "started_utc", std::string("2024-01-01T00:00:00Z"));
  }});
  const auto reader = open_log(path_);
  EXPECT_FALSE(reader->runs()[2].complete);
  EXPECT_EQ(reader->runs()[2].samples, 5U);
  EXPECT_EQ(reader->runs()[2].started_utc, "2024-01-01T00:00:00Z");
}

TEST_F(Hdf5Log, NamesTheValueThatIsNotFinite) {
  for (const bool actuator : {true, false}) {
    write({.ids = {}, .change = [&](Hdf5File& file) {
             Values u = actuators(0);
             Values y = sensors(0);
             (actuator ? u[3 * 17 + 1] : y[2 * 17 + 1]) = std::numeric_limits<double>::infinity();
             add_run(file, "/runs/0000", {0, 0}, excitation(0, kPeriod), u, y);
           }});
    expect_error<FormatError>([&] { read(0, 12, 12); }, path_.string() + ":/runs/0000: row 17",
                              actuator ? "'z2'" : "'s2'");
    EXPECT_NO_THROW(read(0, 18, 18));
  }
}

TEST_F(Hdf5Log, SeveralThreadsMayRead) {
  write({});
  const auto reader = open_log(path_);
  std::vector<int> good(2, 0);
  std::vector<std::thread> threads;
  for (std::size_t run = 0; run < 2; ++run) {
    threads.emplace_back([&, run] {
      LogSamples samples;
      for (int repeat = 0; repeat < 50; ++repeat) {
        reader->read(run, 0, kRows, samples);
        good[run] += samples.actuators(20, 1) == test::actuator_value(run, 20, 1) ? 1 : 0;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_THAT(good, testing::Each(50));
}

// Written by an independent program: bool attributes, float32, variable-length strings.
TEST(ForeignLog, IsRead) {
  const auto file = std::filesystem::path(STAGEID_SOURCE_DIR) / "../shared/data/foreign_log/log.h5";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not here";
  const auto reader = open_log(file);
  EXPECT_EQ(reader->info().sample_rate_hz, 5000.0);
  EXPECT_EQ(reader->info().period_samples, 10000);
  EXPECT_EQ(reader->info().actuators.size(), 13U);
  EXPECT_EQ(reader->info().sensors.units, std::vector<std::string>(4, "m"));
  ASSERT_EQ(reader->runs().size(), 26U);
  LogSamples samples;
  reader->read(25, 10000, 20000, samples);
  EXPECT_GT(samples.actuators.norm(), 0.0);
  EXPECT_EQ(reader->excitation(25).rows(), 10000);
}

}  // namespace stageid::test_hdf5_log
