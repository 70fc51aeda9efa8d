#include "acquisition/files/hdf5_file.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <complex>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <thread>

#include "acquisition/files/file_error.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/support/process/directory_test.hpp"
#include "tests/support/process/file_bytes.hpp"
#include "tests/support/process/file_size_limit.hpp"

namespace stageid::test_hdf5_file {

namespace fs = std::filesystem;
using test::expect_error;
using Complex = std::complex<double>;

using Action = std::function<void()>;

/// A file with objects of every kind.
fs::path with_everything(const fs::path& path) {
  Hdf5File file = Hdf5File::create(path);
  file.write_attribute("/", "rate", 1.0 / 3.0);
  file.write_attribute("/", "count", -9'007'199'254'740'993LL);
  file.write_attribute("/", "title", std::string("5 \xC2\xB5m"));
  file.write_attribute("/", "units", std::vector<std::string>{"N", "", "m/s"});
  file.write_attribute("/", "scale", std::vector<double>{0.5, -2.0});
  file.create_group("/runs/0001");
  const double reals[6] = {1.0, -0.0, 1e308, std::numeric_limits<double>::quiet_NaN(), 5e-324, 7.0};
  file.write_reals("/runs/0001/reals", {2, 3}, reals);
  const Complex complex[2] = {{1.0, -2.0}, {0.25, 1e-300}};
  file.write_complex("/complex", {2, 1, 1}, complex);
  const long long integers[3] = {-1, 0, 9'007'199'254'740'993LL};
  file.write_integers("/integers", {3}, integers);
  file.write_texts("/texts", {"z1", "", "a long name with blanks "});
  file.write_attribute("/texts", "unit", std::string("N"));
  file.create_growing("/table", 2, H5T_IEEE_F32LE, 4);
  file.create_growing("/marks", 0, H5T_STD_U8LE, 4);
  for (int block = 0; block < 5; ++block) {
    const double rows[6] = {block + 0.25, 1, block + 0.5, 2, block + 0.75, 3};
    file.append_rows("/table", 3, rows);
    const unsigned char marks[3] = {0, 1, 255};
    file.append_rows("/marks", 3, marks);
  }
  file.append_rows("/table", 0, static_cast<const double*>(nullptr));
  file.close();
  return path;
}

using Hdf5FileTest = test::DirectoryTest;

struct Hdf5FileOfAllKinds : Hdf5FileTest {
  const Hdf5File file = Hdf5File::open(with_everything(directory_ / "f.h5"));
};

TEST_F(Hdf5FileOfAllKinds, GivesBackAllThatWasWritten) {
  EXPECT_EQ(file.read_real_attribute("/", "rate"), 1.0 / 3.0);
  EXPECT_EQ(file.read_integer_attribute("/", "count"), -9'007'199'254'740'993LL);
  EXPECT_EQ(file.read_text_attribute("/", "title"), "5 \xC2\xB5m");
  EXPECT_EQ(file.read_texts_attribute("/", "units"), (std::vector<std::string>{"N", "", "m/s"}));
  EXPECT_EQ(file.read_texts_attribute("/", "title").size(), 1U);
  EXPECT_EQ(file.read_reals_attribute("/", "scale"), (std::vector<double>{0.5, -2.0}));
  EXPECT_EQ(file.read_reals_attribute("/", "rate"), (std::vector<double>{1.0 / 3.0}));
  EXPECT_EQ(file.read_text_attribute("/texts", "unit"), "N");

  const std::vector<double> reals = file.read_reals("/runs/0001/reals");
  EXPECT_EQ(file.shape("/runs/0001/reals"), (std::vector<hsize_t>{2, 3}));
  ASSERT_EQ(reals.size(), 6U);
  EXPECT_TRUE(std::signbit(reals[1]));
  EXPECT_EQ(reals[2], 1e308);
  EXPECT_TRUE(std::isnan(reals[3]));
  EXPECT_EQ(reals[4], 5e-324);

  EXPECT_EQ(file.shape("/complex"), (std::vector<hsize_t>{2, 1, 1}));
  EXPECT_EQ(file.read_complex("/complex"), (std::vector<Complex>{{1.0, -2.0}, {0.25, 1e-300}}));
  EXPECT_EQ(file.read_reals("/integers")[0], -1.0);
  EXPECT_EQ(file.read_texts("/texts"),
            (std::vector<std::string>{"z1", "", "a long name with blanks "}));
}

TEST_F(Hdf5FileOfAllKinds, KnowsWhatThereIs) {
  EXPECT_TRUE(file.exists("/"));
  EXPECT_TRUE(file.exists("/runs/0001/reals"));
  EXPECT_FALSE(file.exists("/runs/0002"));
  EXPECT_FALSE(file.exists("/absent/0002/reals"));
  EXPECT_FALSE(file.exists("/texts/below_a_dataset"));
  EXPECT_TRUE(file.has_attribute("/texts", "unit"));
  EXPECT_FALSE(file.has_attribute("/texts", "scale"));
  EXPECT_FALSE(file.has_attribute("/absent", "unit"));
  EXPECT_EQ(file.children("/"),
            (std::vector<std::string>{"complex", "integers", "marks", "runs", "table", "texts"}));
  EXPECT_EQ(file.children("/runs"), (std::vector<std::string>{"0001"}));
  EXPECT_EQ(file.kind("/runs/0001/reals"), Hdf5Kind::real);
  EXPECT_EQ(file.kind("/integers"), Hdf5Kind::integer);
  EXPECT_EQ(file.kind("/complex"), Hdf5Kind::complex);
  EXPECT_EQ(file.kind("/texts"), Hdf5Kind::text);
}

TEST_F(Hdf5FileOfAllKinds, ReadsRowsAnywhere) {
  ASSERT_EQ(file.shape("/table"), (std::vector<hsize_t>{15, 2}));
  const std::vector<double> all = file.read_reals("/table");
  EXPECT_EQ(all[2 * 13], 4.5);  // row 13 is the second of the fifth block
  for (hsize_t first = 0; first <= 15; ++first) {
    for (hsize_t count = 0; first + count <= 15; ++count) {
      std::vector<double> rows(2 * count + 1, -7.0);
      file.read_rows("/table", first, count, rows.data());
      for (std::size_t i = 0; i < 2 * count; ++i) ASSERT_EQ(rows[i], all[2 * first + i]);
      ASSERT_EQ(rows.back(), -7.0) << "written past the rows asked for";
    }
  }
  std::vector<double> marks(4);
  file.read_rows("/marks", 2, 4, marks.data());
  EXPECT_EQ(marks, (std::vector<double>{255, 0, 1, 255}));
  EXPECT_EQ(file.shape("/marks"), (std::vector<hsize_t>{15}));
}

TEST_F(Hdf5FileTest, IntegersAndFloatsStandForEachOtherInAttributes) {
  {
    Hdf5File file = Hdf5File::create(directory_ / "g.h5");
    file.write_attribute("/", "float", 40'000.0);
    file.write_attribute("/", "half", 0.5);
    file.write_attribute("/", "huge", 1e300);
    file.write_attribute("/", "nan", std::numeric_limits<double>::quiet_NaN());
    file.write_attribute("/", "integer", 3LL);
    file.close();
  }
  const Hdf5File file = Hdf5File::open(directory_ / "g.h5");
  EXPECT_EQ(file.read_integer_attribute("/", "float"), 40'000);
  EXPECT_EQ(file.read_real_attribute("/", "integer"), 3.0);
  for (const char* name : {"half", "huge", "nan"})
    expect_error<FormatError>([&] { file.read_integer_attribute("/", name); }, file.path(), name);
}

TEST_F(Hdf5FileTest, WritesTheSameBytesAtAnotherTime) {
  const std::string first = test::read_bytes(with_everything(directory_ / "first.h5"));
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // HDF5 stores whole seconds
  EXPECT_EQ(test::read_bytes(with_everything(directory_ / "second.h5")), first);
}

TEST_F(Hdf5FileTest, WritesEmptyThings) {
  {
    Hdf5File file = Hdf5File::create(directory_ / "f.h5");
    file.write_reals("/none", {0, 3}, nullptr);
    file.write_texts("/no_texts", {});
    file.write_attribute("/", "nothing", std::vector<std::string>{});
    file.write_attribute("/", "no_numbers", std::vector<double>{});
    const double value = 2.5;
    file.write_reals("/scalar", {}, &value);
    file.close();
  }
  const Hdf5File file = Hdf5File::open(directory_ / "f.h5");
  EXPECT_TRUE(file.read_reals("/none").empty());
  EXPECT_TRUE(file.read_texts("/no_texts").empty());
  EXPECT_TRUE(file.read_texts_attribute("/", "nothing").empty());
  EXPECT_TRUE(file.read_reals_attribute("/", "no_numbers").empty());
  EXPECT_EQ(file.read_reals("/scalar"), std::vector<double>{2.5});
  file.read_rows("/none", 0, 0, nullptr);
}

TEST_F(Hdf5FileOfAllKinds, NamesFilePlaceAndRemedyOfWhatIsWrong) {
  double sink[64];
  const auto wrong = [&](const Action& action, const std::string& place, const char* word) {
    expect_error<FormatError>(action, file.path().string() + ":" + place + ": ", word);
  };
  wrong([&] { file.read_reals("/absent"); }, "/absent", "missing");
  wrong([&] { file.read_reals("/runs"); }, "/runs", "expected a dataset");
  wrong([&] { file.read_reals("/texts"); }, "/texts", "contains text; expected real numbers");
  wrong([&] { file.read_reals("/complex"); }, "/complex", "contains complex numbers");
  wrong([&] { file.read_complex("/table"); }, "/table", "contains real numbers; expected complex");
  wrong([&] { file.read_texts("/table"); }, "/table", "a list of strings");
  wrong([&] { file.read_rows("/table", 13, 3, sink); }, "/table", "has 15 rows");
  wrong([&] { file.read_rows("/table", ~hsize_t{0}, 1, sink); }, "/table", "has 15 rows");
  wrong([&] { file.read_rows("/complex", 0, 1, sink); }, "/complex", "real numbers");
  wrong([&] { file.shape("/absent"); }, "/absent", "missing");
  wrong([&] { file.kind("/absent"); }, "/absent", "missing");
  wrong([&] { file.children("/absent"); }, "/absent", "missing");
  wrong([&] { file.children("/table"); }, "/table", "expected a group");
  wrong([&] { file.read_real_attribute("/", "absent"); }, "/", "'absent' is missing");
  wrong([&] { file.read_real_attribute("/absent", "x"); }, "/absent", "missing");
  wrong([&] { file.read_real_attribute("/", "title"); }, "/",
        "'title' contains text; expected a number");
  wrong([&] { file.read_real_attribute("/", "scale"); }, "/", "'scale' has 2 values");
  wrong([&] { file.read_integer_attribute("/", "title"); }, "/", "expected an integer");
  wrong([&] { file.read_text_attribute("/", "rate"); }, "/",
        "contains real numbers; expected a string");
  wrong([&] { file.read_text_attribute("/", "units"); }, "/", "'units' has 3 values");
  wrong([&] { file.read_texts_attribute("/", "rate"); }, "/",
        "contains real numbers; expected strings");
  wrong([&] { file.read_reals_attribute("/", "units"); }, "/", "contains text; expected numbers");
}

TEST_F(Hdf5FileTest, SaysThatWritingIsImpossible) {
  expect_error<FileError>([&] { Hdf5File::create(directory_ / "absent/f.h5"); },
                          directory_ / "absent/f.h5", std::strerror(ENOENT));
  expect_error<FileError>([&] { Hdf5File::create(directory_ / "absent/.tmp", "shown.h5"); },
                          "shown.h5", std::strerror(ENOENT));
  Hdf5File file = Hdf5File::create(directory_ / "f.h5");
  const double value = 1.0;
  file.write_reals("/twice", {1}, &value);
  file.write_attribute("/", "twice", 1.0);
  const auto wrong = [&](const Action& action, const std::string& place, const char* word) {
    expect_error<FileError>(action, file.path().string() + ":" + place, word);
  };
  wrong([&] { file.write_reals("/twice", {1}, &value); }, "/twice", "exists");
  wrong([&] { file.write_reals("/no/group", {1}, &value); }, "/no/group", "cannot be written");
  wrong([&] { file.write_attribute("/", "twice", 1.0); }, "/", "attribute 'twice': already exists");
  wrong([&] { file.create_group("/twice/below"); }, "/twice/below", "cannot be written");
  wrong([&] { file.append_rows("/twice", 1, &value); }, "/twice", "cannot be written");
  wrong([&] { file.create_growing("/zero", 1, H5T_IEEE_F64LE, 0); }, "/zero", "cannot be written");
}

TEST_F(Hdf5FileTest, SaysThatTheDiskIsFull) {
  const std::vector<double> many(100'000, 1.0);
  const auto write = [&] {
    Hdf5File file = Hdf5File::create(directory_ / "f.h5", "target.h5");
    file.write_reals("/many", {many.size()}, many.data());
    file.create_growing("/growing", 0, H5T_IEEE_F64LE, 1000);
    file.append_rows("/growing", many.size(), many.data());
    file.close();
  };
  for (const rlim_t bytes : {100, 5000, 900'000, 1'600'000}) {
    const test::FileSizeLimit limit(bytes);
    expect_error<FileError>(write, "target.h5", std::strerror(EFBIG));
  }
  write();  // the library keeps no data of it
}

TEST_F(Hdf5FileTest, SaysThatADeviceIsFull) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "there is no /dev/full here";
  const auto write = [] {
    Hdf5File file = Hdf5File::create("/dev/full");
    file.write_attribute("/", "title", std::string("x"));
    file.close();
  };
  expect_error<FileError>(write, "/dev/full", std::strerror(ENOSPC));
}

TEST_F(Hdf5FileTest, CloseTwiceIsOnce) {
  Hdf5File file = Hdf5File::create(directory_ / "f.h5");
  file.close();
  file.close();
  EXPECT_TRUE(Hdf5File::open(directory_ / "f.h5").exists("/"));
}

}  // namespace stageid::test_hdf5_file
