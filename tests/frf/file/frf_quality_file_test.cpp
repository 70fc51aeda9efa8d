// Detection lines, the test of linearity and dropped periods in frf.h5.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "frf/file/frf_file.hpp"
#include "tests/support/logs/hdf5_surgery.hpp"
#include "tests/support/models/numbered_frf.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid {
namespace test_frf_quality_file {

using testing::HasSubstr;

Eigen::MatrixXd numbered(Eigen::Index rows, Eigen::Index columns, double from) {
  Eigen::MatrixXd matrix(rows, columns);
  for (Eigen::Index i = 0; i < matrix.size(); ++i) matrix.data()[i] = from + static_cast<double>(i);
  return matrix;
}

/// 2 outputs, 3 inputs, 4 lines; 5 detection lines, 3 groups, 2 bands.
FrfEstimate with_quality() {
  FrfEstimate frf = test::numbered_frf();
  frf.detection.frequency_hz = numbered(5, 1, 1.25);
  frf.detection.line = Eigen::VectorXi{{2, 3, 4, 6, 8}};
  frf.detection.groups = {"a1", "a2", "a3"};
  frf.detection.runs = numbered(3, 1, 2.0);
  frf.detection.power = numbered(6, 5, 10.0);
  frf.detection.noise = numbered(2, 5, 60.0);
  frf.detection.noise_dof = 12.0;
  frf.detection.linear_power = numbered(6, 4, 100.0);
  frf.nonlinearity.band_hz = numbered(2, 2, 1.0);
  frf.nonlinearity.p_value = numbered(6, 2, 0.5);
  frf.nonlinearity.distortion = numbered(6, 2, 0.25);
  frf.nonlinearity.settled_p_value = numbered(2, 1, 0.125);
  frf.nonlinearity.even = {numbered(6, 2, 20.0), numbered(6, 2, 40.0)};
  frf.nonlinearity.odd = {numbered(6, 2, 30.0), numbered(6, 2, 50.0)};
  frf.dropped_periods = {{0, 1, 4, "a marked sample"}, {2, 0, 7, "12 times the scatter"}};
  frf.left_out_realizations = {{3, "run.slog:/runs/0007: each of its 4 periods"}};
  return frf;
}

class FrfQualityFile : public testing::Test {
 protected:
  test::TemporaryDirectory directory_;
  std::filesystem::path file_ = directory_.path() / "frf.h5";
};

TEST_F(FrfQualityFile, EverythingComesBack) {
  const FrfEstimate frf = with_quality();
  write_frf(file_, frf);
  const FrfEstimate back = read_frf(file_);
  EXPECT_EQ(back.detection.frequency_hz, frf.detection.frequency_hz);
  EXPECT_EQ(back.detection.line, frf.detection.line);
  EXPECT_EQ(back.detection.groups, frf.detection.groups);
  EXPECT_EQ(back.detection.runs, frf.detection.runs);
  EXPECT_EQ(back.detection.power, frf.detection.power);
  EXPECT_EQ(back.detection.noise, frf.detection.noise);
  EXPECT_EQ(back.detection.noise_dof, frf.detection.noise_dof);
  EXPECT_EQ(back.detection.linear_power, frf.detection.linear_power);
  EXPECT_EQ(back.nonlinearity.band_hz, frf.nonlinearity.band_hz);
  EXPECT_EQ(back.nonlinearity.p_value, frf.nonlinearity.p_value);
  EXPECT_EQ(back.nonlinearity.distortion, frf.nonlinearity.distortion);
  EXPECT_EQ(back.nonlinearity.settled_p_value, frf.nonlinearity.settled_p_value);
  EXPECT_EQ(back.nonlinearity.even.p_value, frf.nonlinearity.even.p_value);
  EXPECT_EQ(back.nonlinearity.odd.level, frf.nonlinearity.odd.level);
  EXPECT_EQ(back.dropped_periods, frf.dropped_periods);
  EXPECT_EQ(back.left_out_realizations, frf.left_out_realizations);
}

// The layout of docs/formats.md, element by element.
TEST_F(FrfQualityFile, DatasetsAreAsDocumented) {
  const FrfEstimate frf = with_quality();
  write_frf(file_, frf);
  const Hdf5File h5 = Hdf5File::open(file_);
  EXPECT_THAT(h5.shape("/detection_power"), testing::ElementsAre(5u, 2u, 3u));
  // [line 1, output 1, group 2]
  EXPECT_EQ(h5.read_reals("/detection_power")[(1 * 2 + 1) * 3 + 2],
            frf.detection.power(1 + 2 * 2, 1));
  EXPECT_THAT(h5.shape("/detection_noise"), testing::ElementsAre(5u, 2u));
  EXPECT_EQ(h5.read_reals("/detection_noise")[3 * 2 + 1], frf.detection.noise(1, 3));
  EXPECT_THAT(h5.shape("/nonlinearity_p_value"), testing::ElementsAre(2u, 2u, 3u));
  EXPECT_EQ(h5.read_reals("/nonlinearity_p_value")[(1 * 2 + 0) * 3 + 1],
            frf.nonlinearity.p_value(0 + 2 * 1, 1));
  EXPECT_EQ(h5.read_reals("/nonlinearity_band_hz")[1], frf.nonlinearity.band_hz(0, 1));
  EXPECT_THAT(h5.read_reals("/dropped_periods"), testing::ElementsAre(0, 1, 4, 2, 0, 7));
  EXPECT_EQ(h5.read_text_attribute("/", "method"), "periodic");
}

TEST_F(FrfQualityFile, MethodAndSmoothingComeBack) {
  FrfEstimate frf = test::numbered_frf();
  frf.method = FrfMethod::lpm;
  frf.covariance_lines = 9;
  write_frf(file_, frf);
  const FrfEstimate back = read_frf(file_);
  EXPECT_EQ(back.method, FrfMethod::lpm);
  EXPECT_EQ(back.covariance_lines, 9);
  EXPECT_EQ(back.nonlinearity.band_hz.size(), 0);
  EXPECT_TRUE(back.dropped_periods.empty());
}

std::string message_of(const std::filesystem::path& file) {
  return test::error_message<FormatError>([&] { read_frf(file); });
}

TEST_F(FrfQualityFile, SpoiltDatasetsAreNamed) {
  for (const char* dataset :
       {"/detection_line", "/detection_power", "/detection_noise", "/detection_runs",
        "/detection_linear_power", "/dropped_periods", "/left_out_realizations",
        "/nonlinearity_p_value", "/nonlinearity_settled_p_value", "/nonlinearity_even_level"}) {
    write_frf(file_, with_quality());
    test::Hdf5Surgery(file_).reshape(dataset, {7});
    EXPECT_THAT(message_of(file_), HasSubstr(dataset)) << dataset;
  }
  FrfEstimate frf = with_quality();
  frf.detection.noise(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(write_frf(file_, frf), std::invalid_argument);
  frf = with_quality();
  frf.nonlinearity.p_value.resize(6, 1);
  EXPECT_THROW(write_frf(file_, frf), std::invalid_argument);
}

}  // namespace test_frf_quality_file
}  // namespace stageid
