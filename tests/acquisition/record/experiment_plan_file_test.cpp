#include <gtest/gtest.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>
#include <string>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/record/experiment_plan_file.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/support/process/directory_test.hpp"
#include "tests/support/process/file_bytes.hpp"
#include "tests/support/process/file_size_limit.hpp"

namespace stageid::test_experiment_plan_file {

namespace fs = std::filesystem;
using test::expect_error;
using test::TemporaryDirectory;

FrequencyGrid grid() {
  return FrequencyGrid::band(
      1000.0, 200,
      {.low_hz = 5.0, .high_hz = 300.0, .selection = LineSelection::odd_random, .seed = 3});
}

ExperimentSpec spec(int crest_iterations = 0) {
  ExperimentSpec spec;
  spec.scheme = ExcitationScheme::orthogonal_dft;
  spec.scaling = AmplitudeScaling::peak;
  spec.axes = {{"z1", 2.0, {}}, {"z2", 0.25, Eigen::VectorXd::LinSpaced(grid().size(), 1.0, 3.0)}};
  spec.realizations = 3;
  spec.periods = 4;
  spec.transient_periods = 0;
  spec.crest_iterations = crest_iterations;
  spec.seed = ~std::uint64_t{0};
  return spec;
}

using ExperimentPlanFile = test::DirectoryTest;

TEST_F(ExperimentPlanFile, GivesAZipperedPlanBack) {
  ExperimentSpec zippered = spec(15);
  zippered.scheme = ExcitationScheme::zippered;
  const ExperimentPlan plan(grid(), zippered);
  write_experiment_plan(directory_ / "plan.h5", plan);
  const ExperimentPlan back = read_experiment_plan(directory_ / "plan.h5");
  EXPECT_EQ(back.spec().scheme, ExcitationScheme::zippered);
  EXPECT_EQ(back.experiments(), 1);
  ASSERT_EQ(back.mixing(), (Eigen::MatrixXcd::Ones(2, 1)));
  for (const RunId run : plan.runs()) EXPECT_EQ(back.excitation(run), plan.excitation(run));
}

TEST_F(ExperimentPlanFile, GivesTheSamePlanBack) {
  for (const int crest_iterations : {0, 15}) {
    const ExperimentPlan plan(grid(), spec(crest_iterations));
    write_experiment_plan(directory_ / "plan.h5", plan);
    const ExperimentPlan back = read_experiment_plan(directory_ / "plan.h5");

    EXPECT_EQ(back.grid(), plan.grid());
    EXPECT_EQ(back.spec().scheme, plan.spec().scheme);
    EXPECT_EQ(back.spec().scaling, plan.spec().scaling);
    EXPECT_EQ(back.spec().realizations, 3);
    EXPECT_EQ(back.spec().periods, 4);
    EXPECT_EQ(back.spec().transient_periods, 0);
    EXPECT_EQ(back.spec().crest_iterations, crest_iterations);
    EXPECT_EQ(back.spec().seed, ~std::uint64_t{0});
    ASSERT_EQ(back.experiments(), 2);
    for (std::size_t p = 0; p < 2; ++p) {
      EXPECT_EQ(back.spec().axes[p].channel, plan.spec().axes[p].channel);
      EXPECT_EQ(back.spec().axes[p].level, plan.spec().axes[p].level);
      EXPECT_EQ(back.spec().axes[p].shape, plan.spec().axes[p].shape);
    }
    for (const RunId run : plan.runs())
      EXPECT_EQ(back.excitation(run), plan.excitation(run)) << "not the same bits";
  }
}

TEST_F(ExperimentPlanFile, WritesTheSameBytesTwiceAndLeavesNothingElse) {
  const ExperimentPlan plan(grid(), spec());
  write_experiment_plan(directory_ / "a.h5", plan);
  write_experiment_plan(directory_ / "b.h5", plan);
  EXPECT_EQ(test::bytes_of(directory_ / "a.h5"), test::bytes_of(directory_ / "b.h5"));
  EXPECT_EQ(std::distance(fs::directory_iterator(directory_.path()), fs::directory_iterator()), 2);
}

TEST_F(ExperimentPlanFile, AFullDiskLeavesNothingBehind) {
  const ExperimentPlan plan(grid(), spec());
  {
    const test::FileSizeLimit limit(3000);
    expect_error<FileError>([&] { write_experiment_plan(directory_ / "plan.h5", plan); },
                            directory_ / "plan.h5", std::strerror(EFBIG));
  }
  EXPECT_TRUE(fs::is_empty(directory_.path()));
  expect_error<FileError>([&] { write_experiment_plan(directory_ / "no/plan.h5", plan); },
                          directory_ / "no/plan.h5", std::strerror(ENOENT));
}

/// Writes a plan, lets `change` corrupt the HDF5 file, and expects `word` in the reader's message.
void expect_spoilt(int crest_iterations, const std::string& place, const std::string& word,
                   const std::function<void(hid_t)>& change) {
  const TemporaryDirectory directory;
  const fs::path path = directory / "plan.h5";
  write_experiment_plan(path, ExperimentPlan(grid(), spec(crest_iterations)));
  {
    const Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
    change(file.get());
  }
  expect_error<FormatError>([&] { read_experiment_plan(path); }, path.string() + ":" + place, word);
}

void set_integer(hid_t file, const char* name, long long value) {
  const Hdf5Handle attribute(H5Aopen(file, name, H5P_DEFAULT), H5Aclose);
  ASSERT_GE(H5Awrite(attribute.get(), H5T_NATIVE_LLONG, &value), 0);
}

void set_text(hid_t file, const char* name, const char* value) {
  const Hdf5Handle attribute(H5Aopen(file, name, H5P_DEFAULT), H5Aclose);
  const Hdf5Handle type(H5Aget_type(attribute.get()), H5Tclose);
  ASSERT_GE(H5Awrite(attribute.get(), type.get(), &value), 0);
}

/// Changes the first number of a dataset of reals (or of the r, i of complex numbers).
std::function<void(hid_t)> with_first(const std::string& name, double value) {
  return [name, value](hid_t file) {
    const Hdf5Handle dataset(H5Dopen2(file, name.c_str(), H5P_DEFAULT), H5Dclose);
    const Hdf5Handle type(H5Dget_type(dataset.get()), H5Tclose);
    const Hdf5Handle space(H5Dget_space(dataset.get()), H5Sclose);
    const auto count = static_cast<std::size_t>(H5Sget_simple_extent_npoints(space.get()));
    std::vector<char> bytes(count * H5Tget_size(type.get()));
    ASSERT_GE(H5Dread(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), 0);
    std::memcpy(bytes.data(), &value, sizeof value);
    ASSERT_GE(H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), 0);
  };
}

std::function<void(hid_t)> without(const std::string& name) {
  return [name](hid_t file) { ASSERT_GE(H5Ldelete(file, name.c_str(), H5P_DEFAULT), 0); };
}

TEST_F(ExperimentPlanFile, NoticesNumbersThatDoNotAgree) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string word = "does not match the seed";
  for (const double value : {1e-3, nan}) {
    for (const int crest : {0, 5}) {
      expect_spoilt(crest, "/amplitude", word, with_first("/amplitude", value));
      expect_spoilt(crest, "/mixing", word, with_first("/mixing", value));
      expect_spoilt(crest, "/realizations/0001/spectrum", word,
                    with_first("/realizations/0001/spectrum", value));
    }
    expect_spoilt(0, "/realizations/0002/phase_rad", word,
                  with_first("/realizations/0002/phase_rad", value));
  }
  expect_spoilt(0, "/amplitude", word, with_first("/level", 5.0));
  expect_spoilt(0, "", "axes[0].shape", with_first("/shape", 0.5));  // the others remain zero
  expect_spoilt(0, "", word, [](hid_t file) { set_text(file, "seed", "1"); });
  expect_spoilt(0, "", word, [](hid_t file) { set_text(file, "scaling", "rms"); });
  // Reduced phases are read from the file, but must be valid.
  expect_spoilt(5, "/realizations/0002/phase_rad", "out of range (0 to 2 pi)",
                with_first("/realizations/0002/phase_rad", nan));
  expect_spoilt(5, "/realizations/0002/phase_rad", "out of range (0 to 2 pi)",
                with_first("/realizations/0002/phase_rad", 7.0));
}

TEST_F(ExperimentPlanFile, NamesWhatIsMissingOrOfTheWrongKind) {
  for (const char* name : {"/lines", "/axes", "/level", "/amplitude", "/mixing",
                           "/realizations/0002/spectrum", "/realizations/0002/phase_rad"}) {
    expect_spoilt(0, name, "missing", without(name));
  }
  expect_spoilt(0, "/realizations", "contains 2 realizations", without("/realizations/0001"));
  expect_spoilt(0, "/", "attribute format is missing",
                [](hid_t file) { H5Adelete(file, "format"); });
  expect_spoilt(0, "/", "format is 'other'; expected 'stageid-excitation'",
                [](hid_t f) { set_text(f, "format", "other"); });
  expect_spoilt(0, "/", "this program reads 1",
                [](hid_t f) { set_integer(f, "format_version", 2); });
  expect_spoilt(0, "/", "'scheme' is 'x'", [](hid_t f) { set_text(f, "scheme", "x"); });
  expect_spoilt(0, "/", "'scaling' is 'x'", [](hid_t f) { set_text(f, "scaling", "x"); });
  for (const char* seed : {"", "-1", "1x", "99999999999999999999"})
    expect_spoilt(0, "/", "'seed' is", [seed](hid_t f) { set_text(f, "seed", seed); });
  for (const char* name : {"realizations", "periods", "transient_periods", "crest_iterations"}) {
    expect_spoilt(0, "/", name, [name](hid_t f) { set_integer(f, name, -1); });
    expect_spoilt(0, "/", name, [name](hid_t f) { set_integer(f, name, 1LL << 40); });
  }
  expect_spoilt(0, " ", "half the sample rate",
                [](hid_t f) { set_integer(f, "period_samples", 50); });
  expect_spoilt(0, " ", "axes[0].level", with_first("/level", -1.0));
}

TEST_F(ExperimentPlanFile, RefusesOtherFiles) {
  expect_error<FileError>([&] { read_experiment_plan(directory_ / "absent.h5"); },
                          directory_ / "absent.h5", std::strerror(ENOENT));
  std::ofstream(directory_ / "text.h5") << "text";
  expect_error<FormatError>([&] { read_experiment_plan(directory_ / "text.h5"); },
                            directory_ / "text.h5", "not an HDF5 file");
}

}  // namespace stageid::test_experiment_plan_file
