#include <gtest/gtest.h>

#include <cerrno>
#include <cstring>
#include <functional>
#include <string>

#include "acquisition/files/file_error.hpp"
#include "acquisition/record/experiment_plan_file.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/support/logs/hdf5_surgery.hpp"
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

TEST_F(ExperimentPlanFile, GivesTheSamePlanBack) {
  ExperimentSpec zippered = spec(15);
  zippered.scheme = ExcitationScheme::zippered;
  for (const ExperimentSpec& written : {spec(0), spec(15), zippered}) {
    const ExperimentPlan plan(grid(), written);
    write_experiment_plan(directory_ / "plan.h5", plan);
    const ExperimentPlan back = read_experiment_plan(directory_ / "plan.h5");

    EXPECT_EQ(back.grid(), plan.grid());
    EXPECT_EQ(back.spec().scheme, written.scheme);
    EXPECT_EQ(back.spec().scaling, written.scaling);
    EXPECT_EQ(back.spec().realizations, 3);
    EXPECT_EQ(back.spec().periods, 4);
    EXPECT_EQ(back.spec().transient_periods, 0);
    EXPECT_EQ(back.spec().crest_iterations, written.crest_iterations);
    EXPECT_EQ(back.spec().seed, ~std::uint64_t{0});
    if (written.scheme == ExcitationScheme::zippered) {
      EXPECT_EQ(back.experiments(), 1);
      EXPECT_EQ(back.mixing(), (Eigen::MatrixXcd::Ones(2, 1)));
    } else {
      EXPECT_EQ(back.experiments(), 2);
    }
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
  EXPECT_EQ(test::read_bytes(directory_ / "a.h5"), test::read_bytes(directory_ / "b.h5"));
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

using Change = std::function<void(test::Hdf5Surgery&)>;

/// Writes a plan, lets `change` corrupt the file, and expects `word` in the reader's message.
void expect_spoilt(int crest_iterations, const std::string& place, const std::string& word,
                   const Change& change) {
  const TemporaryDirectory directory;
  const fs::path path = directory / "plan.h5";
  write_experiment_plan(path, ExperimentPlan(grid(), spec(crest_iterations)));
  {
    test::Hdf5Surgery surgery(path);
    change(surgery);
  }
  expect_error<FormatError>([&] { read_experiment_plan(path); }, path.string() + ":" + place, word);
}

/// Sets an attribute of long long or const char*.
template <typename Value>
Change with(const char* name, Value value) {
  return [=](test::Hdf5Surgery& file) { file.set_attribute("/", name, value); };
}

/// Changes the first number of a dataset.
Change with_first(const char* name, double value) {
  return [=](test::Hdf5Surgery& file) { file.poke(name, 0, value); };
}

Change without(const char* name) {
  return [=](test::Hdf5Surgery& file) { file.remove(name); };
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
  expect_spoilt(0, "", word, with("seed", "1"));
  expect_spoilt(0, "", word, with("scaling", "rms"));
  // Reduced phases are read from the file, but must be valid.
  for (const double phase : {nan, 7.0})
    expect_spoilt(5, "/realizations/0002/phase_rad", "out of range (0 to 2 pi)",
                  with_first("/realizations/0002/phase_rad", phase));
}

TEST_F(ExperimentPlanFile, NamesWhatIsMissingOrOfTheWrongKind) {
  for (const char* name : {"/lines", "/axes", "/level", "/amplitude", "/mixing",
                           "/realizations/0002/spectrum", "/realizations/0002/phase_rad"}) {
    expect_spoilt(0, name, "missing", without(name));
  }
  expect_spoilt(0, "/realizations", "contains 2 realizations", without("/realizations/0001"));
  expect_spoilt(0, "/", "attribute format is missing",
                [](test::Hdf5Surgery& file) { file.remove_attribute("/", "format"); });
  expect_spoilt(0, "/", "format is 'other'; expected 'stageid-excitation'",
                with("format", "other"));
  expect_spoilt(0, "/", "this program reads 1", with("format_version", 2LL));
  expect_spoilt(0, "/", "'scheme' is 'x'", with("scheme", "x"));
  expect_spoilt(0, "/", "'scaling' is 'x'", with("scaling", "x"));
  for (const char* seed : {"", "-1", "1x", "99999999999999999999"})
    expect_spoilt(0, "/", "'seed' is", with("seed", seed));
  for (const char* name : {"realizations", "periods", "transient_periods", "crest_iterations"})
    for (const long long value : {-1LL, 1LL << 40}) expect_spoilt(0, "/", name, with(name, value));
  expect_spoilt(0, " ", "half the sample rate", with("period_samples", 50LL));
  expect_spoilt(0, " ", "axes[0].level", with_first("/level", -1.0));
}

}  // namespace stageid::test_experiment_plan_file
