#include "tools/steps/fft_wisdom_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/input_files.hpp"
#include "excitation/multisine/dft.hpp"
#include "excitation/multisine/random_stream.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_fft_wisdom_file {

using test::expect_error;

constexpr int kLength = 120;  // planned in no time

void write(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

Eigen::VectorXcd spectrum() {
  RealDft dft(kLength);
  UniformStream random(1);
  for (double& value : dft.input()) value = random.next() - 0.5;
  return Eigen::Map<const Eigen::VectorXcd>(dft.forward().data(), dft.half_size());
}

/// With its first line, right for the wisdom given.
std::string with_fingerprint(const std::string& wisdom) {
  return "stageid-fft-wisdom 1 " + fingerprint_of(wisdom) + "\n" + wisdom;
}

struct FftWisdomFileTest : testing::Test {
  std::string make() const {
    FftWisdomFile wisdom(file_);
    RealDft dft(kLength);
    return wisdom.save();
  }
  test::TemporaryDirectory directory_;
  std::filesystem::path file_ = directory_ / "plans";
};

TEST_F(FftWisdomFileTest, TheSecondTimeNothingIsPlannedAnew) {
  Eigen::VectorXcd first;
  std::string plans;
  {
    FftWisdomFile wisdom(file_);
    first = spectrum();
    plans = wisdom.save();
  }
  const std::string kept = read_whole_file(file_);
  EXPECT_THAT(kept, testing::StartsWith("stageid-fft-wisdom 1 " + plans + "\n(fftw"));
  const auto written = std::filesystem::last_write_time(file_) - std::chrono::hours(1);
  std::filesystem::last_write_time(file_, written);
  for (int again = 0; again < 2; ++again) {
    FftWisdomFile wisdom(file_);
    EXPECT_EQ(spectrum(), first);
    EXPECT_EQ(wisdom.save(), plans);
  }
  EXPECT_EQ(read_whole_file(file_), kept);
  EXPECT_EQ(std::filesystem::last_write_time(file_), written) << "written again";
}

TEST_F(FftWisdomFileTest, AnotherLengthIsAdded) {
  const std::string plans = make();
  const std::string kept = read_whole_file(file_);
  FftWisdomFile wisdom(file_);
  RealDft dft(kLength / 3 * 2);
  EXPECT_NE(wisdom.save(), plans);
  EXPECT_GT(read_whole_file(file_).size(), kept.size());
}

// Without the file, plans depend neither on earlier timings nor on earlier files.
TEST_F(FftWisdomFileTest, NothingOfItStays) {
  const Eigen::VectorXcd before = spectrum();
  const std::string plans = make();
  EXPECT_EQ(spectrum(), before);
  FftWisdomFile other(directory_ / "other");
  EXPECT_NE(other.save(), plans);
  EXPECT_LT(read_whole_file(directory_ / "other").size(), read_whole_file(file_).size());
}

TEST_F(FftWisdomFileTest, OnlyOneAtATime) {
  const FftWisdomFile wisdom(file_);
  EXPECT_THROW(FftWisdomFile(directory_ / "other"), std::logic_error);
}

TEST_F(FftWisdomFileTest, DamageIsToldByNameWithTheRemedy) {
  make();
  const std::string whole = read_whole_file(file_);
  std::vector<std::string> damaged = {"",
                                      "x",
                                      whole.substr(0, 30),
                                      whole.substr(0, whole.size() - 1),
                                      whole + "\n",
                                      std::string(5000, '\0')};
  for (std::size_t at = 0; at < whole.size(); at += 97) {
    damaged.push_back(whole);
    damaged.back()[at] = static_cast<char>(damaged.back()[at] ^ 1);
  }
  for (const std::string& bytes : damaged) {
    write(file_, bytes);
    expect_error<FormatError>([&] { const FftWisdomFile wisdom(file_); }, file_.string() + ": ",
                              "remove it");
  }
  write(file_, whole);
  const FftWisdomFile wisdom(file_);  // a refusal leaves nothing behind
}

TEST_F(FftWisdomFileTest, PlansOfAnotherFftwAreToldApartFromDamage) {
  make();
  const std::string whole = read_whole_file(file_);
  std::string wisdom = whole.substr(whole.find('\n') + 1);
  wisdom.replace(wisdom.find("fftw-"), 6, "fftw-9");
  write(file_, with_fingerprint(wisdom));
  expect_error<FormatError>([&] { const FftWisdomFile refused(file_); }, file_.string() + ": ",
                            "another FFTW version or processor type; remove it");
  const std::string garbage = "(fftw-3.3 (((((";
  write(file_, with_fingerprint(garbage));
  EXPECT_THROW(FftWisdomFile{file_}, FormatError);
}

TEST_F(FftWisdomFileTest, AFolderThatTakesNoFileIsToldBeforeTheWork) {
  const auto nowhere = directory_ / "missing" / "plans";
  expect_error<FileError>([&] { const FftWisdomFile wisdom(nowhere); }, nowhere.string(),
                          "directory");
  expect_error<FileError>([&] { const FftWisdomFile wisdom(directory_.path()); },
                          directory_.path().string(), "is not a regular file");
  EXPECT_TRUE(std::filesystem::is_empty(directory_.path()));
}

}  // namespace stageid::test_fft_wisdom_file
