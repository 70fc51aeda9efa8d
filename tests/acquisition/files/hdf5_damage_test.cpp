#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <numeric>
#include <string>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/support/process/directory_test.hpp"
#include "tests/support/process/file_bytes.hpp"

namespace stageid::test_hdf5_damage {

namespace fs = std::filesystem;
using test::expect_error;
using test::TemporaryDirectory;
using test::write_bytes;

std::string healthy_file(const TemporaryDirectory& directory) {
  Hdf5File file = Hdf5File::create(directory / "healthy.h5");
  std::vector<double> values(std::size_t{1234} * 7);
  std::iota(values.begin(), values.end(), 0.0);
  file.write_attribute("/", "format", std::string("test"));
  file.write_texts("/names", {"one", "two"});
  file.write_reals("/values", {1234, 7}, values.data());
  file.create_growing("/rows", 2, H5T_IEEE_F64LE, 100);
  file.append_rows("/rows", 500, values.data());
  file.close();
  return test::read_bytes(directory / "healthy.h5");
}

struct Everything {
  std::vector<std::string> names;
  std::vector<double> values, rows, last_row;
  bool operator==(const Everything&) const = default;
};

bool has_nan(const Everything& all) {
  const auto nan = [](double value) { return std::isnan(value); };
  return std::ranges::any_of(all.values, nan) || std::ranges::any_of(all.rows, nan);
}

/// Reads everything; any damage must be reported as FormatError.
Everything read_everything(const fs::path& path) {
  const Hdf5File file = Hdf5File::open(path);
  file.children("/");
  file.read_text_attribute("/", "format");
  Everything all{
      file.read_texts("/names"), file.read_reals("/values"), file.read_reals("/rows"), {}};
  const std::vector<hsize_t> shape = file.shape("/values");
  all.last_row.resize(shape.at(1));
  file.read_rows("/values", shape[0] - 1, 1, all.last_row.data());
  return all;
}

template <typename Error>
void expect_refused(const fs::path& file, const char* reason) {
  expect_error<Error>([&] { Hdf5File::open(file); }, file, reason);
}

using DamagedHdf5 = test::DirectoryTest;

TEST_F(DamagedHdf5, IsToldFromMissingAndForeignFiles) {
  expect_refused<FileError>(directory_ / "absent.h5", std::strerror(ENOENT));
  expect_refused<FileError>(directory_.path(), "is not a regular file");
  for (const char* bytes : {"this is not HDF5\n", ""}) {
    write_bytes(directory_ / "other.h5", bytes);
    expect_refused<FormatError>(directory_ / "other.h5", "not an HDF5 file");
  }
}

TEST_F(DamagedHdf5, CutShortAnywhereIsAFormatError) {
  const std::string healthy = healthy_file(directory_);
  EXPECT_NO_THROW(read_everything(directory_ / "healthy.h5"));
  for (std::size_t length = 0; length < healthy.size(); length += 97) {
    write_bytes(directory_ / "cut.h5", healthy.substr(0, length));
    EXPECT_THROW(read_everything(directory_ / "cut.h5"), FormatError) << length << " bytes";
  }
  write_bytes(directory_ / "cut.h5", healthy.substr(0, healthy.size() - 1));
  expect_refused<FormatError>(directory_ / "cut.h5", "truncated");
}

TEST_F(DamagedHdf5, AHugeSizeDoesNotAskForAllTheMemory) {
  const fs::path path = directory_ / "hostile.h5";
  for (const hsize_t rows : {hsize_t{1} << 34, hsize_t{1} << 61}) {
    {
      // Datasets that were declared and never written have a shape and no bytes.
      const Hdf5Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT),
                            H5Fclose);
      const hsize_t shape[2] = {rows, 7};
      const hsize_t chunk[2] = {100, 7};
      const Hdf5Handle space(H5Screate_simple(2, shape, nullptr), H5Sclose);
      const Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
      H5Pset_chunk(properties.get(), 2, chunk);
      const auto create = [&](const char* name, hid_t type, hid_t creation) {
        const Hdf5Handle dataset(
            H5Dcreate2(file.get(), name, type, space.get(), H5P_DEFAULT, creation, H5P_DEFAULT),
            H5Dclose);
        ASSERT_TRUE(dataset);
      };
      create("values", H5T_IEEE_F64LE, properties.get());
      H5Pset_deflate(properties.get(), 1);
      create("packed", H5T_IEEE_F64LE, properties.get());
      if (rows < hsize_t{1} << 40) create("whole", H5T_IEEE_F64LE, H5P_DEFAULT);
    }
    const Hdf5File file = Hdf5File::open(path);
    for (const std::string& name : file.children("/")) {
      const std::string place = path.string() + ":/" + name + ": ";
      expect_error<FormatError>([&] { file.read_reals("/" + name); }, place, "damaged");
      expect_error<FormatError>([&] { file.shape("/" + name); }, place, "damaged");
    }
  }
}

TEST_F(DamagedHdf5, OneWrongByteIsNoticedOrChangesNothing) {
  // Checksums guard structure and data. (Not the letters of attributes: those stand in a heap that
  // has no checksum.) Unused bytes may change.
  const std::string healthy = healthy_file(directory_);
  const Everything truth = read_everything(directory_ / "healthy.h5");
  int noticed = 0;
  int harmless = 0;
  const auto flip = [&](std::size_t at, int bits) {
    std::string damaged = healthy;
    damaged[at] = static_cast<char>(damaged[at] ^ bits);
    write_bytes(directory_ / "damaged.h5", damaged);
    try {
      const Everything read = read_everything(directory_ / "damaged.h5");
      const bool found = has_nan(read);  // by the caller, who needs numbers
      EXPECT_TRUE(found || read == truth) << "byte " << at << " ^ " << bits;
      ++(found ? noticed : harmless);
    } catch (const FormatError&) {
      ++noticed;
    }
  };
  constexpr std::size_t kStructure = 6000;  // at both ends; the data are between
  for (std::size_t at = 0; at < healthy.size(); at += 7) {
    const bool data = at > kStructure && healthy.size() - at > kStructure;
    if (!data || at % 70 == 0) flip(at, at % 2 == 0 ? 0xFF : 0x01);
  }
  EXPECT_GT(noticed, 1000);
  EXPECT_GT(harmless, 10);
}

TEST_F(DamagedHdf5, AHeapWhoseTextsOverlapIsRefused) {
  const std::string healthy = healthy_file(directory_);
  const std::size_t heap = healthy.find(std::string("GCOL\1\0\0\0", 8));
  ASSERT_NE(heap, std::string::npos);
  // The size of the collection, of its first text, and of the following free space: HDF5 1.10 crashes or hangs for
  // each.
  for (const std::size_t place : {heap + 8, heap + 24, heap + 48}) {
    for (const std::size_t byte : {0, 1, 5}) {
      std::string damaged = healthy;
      damaged[place + byte] = static_cast<char>(damaged[place + byte] ^ 0x80);
      write_bytes(directory_ / "damaged.h5", damaged);
      expect_refused<FormatError>(directory_ / "damaged.h5", "damaged");
    }
  }
}

}  // namespace stageid::test_hdf5_damage
