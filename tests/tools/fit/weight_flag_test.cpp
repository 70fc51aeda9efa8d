// Weights from a file: accepted ones, and rejected ones with the name of the file.

#include "estimation/request/weight_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <complex>
#include <numeric>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "estimation/problem/weight_matrices.hpp"
#include "tests/support/models/numbered_frf.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_weight_flag {

using Complex = std::complex<double>;

/// For two outputs and three inputs, line by line.
void write_weights(const std::filesystem::path& path, const std::vector<double>& values) {
  Hdf5File file = Hdf5File::create(path);
  file.write_reals("/weights", {values.size() / 6, 2, 3}, values.data());
  file.close();
}

struct WeightFile : testing::Test {
  void write_matrices(const std::vector<Complex>& values) {
    Hdf5File file = Hdf5File::create(path_);
    file.write_complex("/weight_matrices", {4, 6, 6}, values.data());
    file.close();
  }
  /// 2 on the diagonal, one coupling on line 1 that distinguishes rows from columns.
  static std::vector<Complex> matrices() {
    std::vector<Complex> values(4 * 36);
    for (std::size_t k = 0; k < 4; ++k)
      for (std::size_t c = 0; c < 6; ++c) values[36 * k + 7 * c] = 2.0;
    values[36 + 6 * 1 + 4] = Complex(0.5, 0.25);
    values[36 + 6 * 4 + 1] = Complex(0.5, -0.25);
    return values;
  }
  template <typename Error = FormatError>
  void expect_refused(const std::string& part) {
    EXPECT_THAT([this] { read_weights(path_, frf_, options_); },
                testing::ThrowsMessage<Error>(
                    testing::AllOf(testing::HasSubstr("weights.h5"), testing::HasSubstr(part))));
  }
  FrfEstimate frf_ = test::numbered_frf();
  test::TemporaryDirectory directory_;
  std::filesystem::path path_ = directory_ / "weights.h5";
  FitOptions options_;
};

TEST_F(WeightFile, DiagonalsAreRowsOfOutputs) {
  std::vector<double> values(4 * 6);
  std::iota(values.begin(), values.end(), 0.0);
  write_weights(path_, values);
  read_weights(path_, frf_, options_);
  EXPECT_EQ((*options_.user_weights)(1 + 2 * 2, 3), 23.0);
  EXPECT_EQ((*options_.user_weights)(0 + 2 * 1, 0), 1.0);
  EXPECT_EQ(options_.user_weight_matrices.size(), 0);
}

TEST_F(WeightFile, MatricesKeepRowAndColumn) {
  write_matrices(matrices());
  read_weights(path_, frf_, options_);
  EXPECT_EQ(options_.user_weight_matrices(1 + 6 * 4, 1), Complex(0.5, 0.25));
  EXPECT_EQ(options_.user_weight_matrices(4 + 6 * 1, 1), Complex(0.5, -0.25));
  EXPECT_EQ(options_.user_weight_matrices(7 * 5, 3), Complex(2.0, 0.0));
}

TEST_F(WeightFile, RefusesMatricesNamingTheLine) {
  std::vector<Complex> values = matrices();
  values[36 + 6 * 4 + 1] = 0.0;
  write_matrices(values);
  expect_refused("line 1 (2.5 Hz): is not Hermitian");
  values = matrices();
  values[2 * 36] = -2.0;
  write_matrices(values);
  expect_refused<IndefiniteWeights>("line 2 (3 Hz): is not positive semidefinite");
}

TEST_F(WeightFile, RefusesAnotherShapeAndBothKindsAtOnce) {
  write_matrices(matrices());
  frf_ = select_band(frf_, 1.0, 3.0);
  expect_refused("has the shape 4 x 6 x 6; expected 3 x 6 x 6");
  Hdf5File file = Hdf5File::create(path_);
  const std::vector<double> diagonals(4 * 6, 1.0);
  file.write_reals("/weights", {4, 2, 3}, diagonals.data());
  file.write_complex("/weight_matrices", {4, 6, 6}, matrices().data());
  file.close();
  expect_refused("one of the two");
}

TEST_F(WeightFile, RefusesWeightsThatAreAllZeroOrBeyondTheRangeOfSquares) {
  for (const auto& [weight, part] : {std::pair{0.0, "all weights are 0"},
                                     {1e-200, "only the ratios of weights matter"},
                                     {1e200, "only the ratios of weights matter"}}) {
    write_weights(path_, std::vector<double>(4 * 6, weight));
    expect_refused(part);
  }
}

}  // namespace stageid::test_weight_flag
