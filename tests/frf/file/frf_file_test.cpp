#include "frf/file/frf_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "tests/support/logs/hdf5_surgery.hpp"
#include "tests/support/models/expect_same_frf.hpp"
#include "tests/support/models/numbered_frf.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/file_bytes.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_frf_file {

using test::numbered_frf;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

class FrfFile : public testing::Test {
 protected:
  std::string read_error(const char* name) const {
    return test::error_message<FormatError>([&] { read_frf(folder_ / name); });
  }

  test::TemporaryDirectory folder_;
};

Eigen::MatrixXd numbered(Eigen::Index rows, Eigen::Index columns, double from) {
  Eigen::MatrixXd matrix(rows, columns);
  for (Eigen::Index i = 0; i < matrix.size(); ++i) matrix.data()[i] = from + static_cast<double>(i);
  return matrix;
}

/// 2 outputs, 3 inputs, 4 lines; 5 detection lines, 3 groups, 2 bands.
FrfEstimate with_quality() {
  FrfEstimate frf = numbered_frf();
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
  frf.replaced_samples = {{1, 0, 2, 345, 6, "9 times the scatter"}};
  frf.left_out_realizations = {{3, "run.slog:/runs/0007: each of its 4 periods"}};
  return frf;
}

TEST_F(FrfFile, GivesBackWhatWasWritten) {
  FrfEstimate lpm = with_quality();
  lpm.method = FrfMethod::lpm;
  lpm.covariance_lines = 9;
  lpm.correlated_lines = 3.5;
  lpm.experiment_noise_ratio = 2.5;
  lpm.interpolation_misfit = numbered(4, 1, 0.5);
  FrfEstimate bare;  // what is unknown stays unknown
  bare.frequency_hz = Eigen::VectorXd::Constant(1, 2.0);
  bare.inputs = {{"a"}, {"N"}};
  bare.outputs = {{"z"}, {"m"}};
  bare.response = Eigen::MatrixXcd::Constant(1, 1, {1.0, 2.0});
  for (const FrfEstimate& frf : {with_quality(), lpm, bare}) {
    write_frf(folder_ / "frf.h5", frf);
    test::expect_same(read_frf(folder_ / "frf.h5"), frf);
  }
}

// The layout of docs/formats.md: [N x n_y x n_u] in C order, as indexed by h5py and MATLAB users.
TEST_F(FrfFile, TheLayoutIsLinesThenOutputsThenInputs) {
  const FrfEstimate frf = numbered_frf();
  write_frf(folder_ / "frf.h5", frf);
  const Hdf5File file = Hdf5File::open(folder_ / "frf.h5");
  EXPECT_EQ(file.read_text_attribute("/", "format"), "stageid-frf");
  EXPECT_EQ(file.read_integer_attribute("/", "format_version"), 1);
  EXPECT_EQ(file.read_text_attribute("/", "hold"), "zoh");
  EXPECT_EQ(file.read_text_attribute("/", "compensated"), "delay");
  EXPECT_EQ(file.read_texts_attribute("/inputs", "unit"),
            (std::vector<std::string>{"N", "N", "Nm"}));
  EXPECT_EQ(file.read_texts_attribute("/outputs", "unit"), (std::vector<std::string>{"m"}));
  EXPECT_EQ(file.shape("/response"), (std::vector<hsize_t>{4, 2, 3}));
  EXPECT_EQ(file.shape("/covariance"), (std::vector<hsize_t>{4, 6, 6}));
  EXPECT_EQ(file.shape("/input_factor"), (std::vector<hsize_t>{4, 3, 3}));
  EXPECT_EQ(file.shape("/residual_covariance"), (std::vector<hsize_t>{4, 2, 2}));
  const std::vector<std::complex<double>> response = file.read_complex("/response");
  const std::vector<double> variance = file.read_reals("/noise_variance");
  const std::vector<std::complex<double>> covariance = file.read_complex("/covariance");
  for (Eigen::Index k = 0; k < 4; ++k) {
    for (Eigen::Index i = 0; i < 2; ++i) {
      for (Eigen::Index j = 0; j < 3; ++j) {
        const auto at = static_cast<std::size_t>((k * 2 + i) * 3 + j);
        EXPECT_EQ(response[at], frf.at(k)(i, j));
        EXPECT_EQ(variance[at], frf.noise_variance(i + 2 * j, k));
      }
    }
    for (Eigen::Index c = 0; c < 6; ++c) {
      for (Eigen::Index d = 0; d < 6; ++d) {
        EXPECT_EQ(covariance[static_cast<std::size_t>((k * 6 + c) * 6 + d)],
                  frf.covariance(c + 6 * d, k));
      }
    }
  }
}

TEST_F(FrfFile, QualityDatasetsAreAsDocumented) {
  const FrfEstimate frf = with_quality();
  write_frf(folder_ / "frf.h5", frf);
  const Hdf5File h5 = Hdf5File::open(folder_ / "frf.h5");
  EXPECT_THAT(h5.shape("/detection_power"), ElementsAre(5u, 2u, 3u));
  // [line 1, output 1, group 2]
  EXPECT_EQ(h5.read_reals("/detection_power")[(1 * 2 + 1) * 3 + 2],
            frf.detection.power(1 + 2 * 2, 1));
  EXPECT_THAT(h5.shape("/detection_noise"), ElementsAre(5u, 2u));
  EXPECT_EQ(h5.read_reals("/detection_noise")[3 * 2 + 1], frf.detection.noise(1, 3));
  EXPECT_THAT(h5.shape("/nonlinearity_p_value"), ElementsAre(2u, 2u, 3u));
  EXPECT_EQ(h5.read_reals("/nonlinearity_p_value")[(1 * 2 + 0) * 3 + 1],
            frf.nonlinearity.p_value(0 + 2 * 1, 1));
  EXPECT_EQ(h5.read_reals("/nonlinearity_band_hz")[1], frf.nonlinearity.band_hz(0, 1));
  EXPECT_THAT(h5.read_reals("/dropped_periods"), ElementsAre(0, 1, 4, 2, 0, 7));
  EXPECT_EQ(h5.read_text_attribute("/", "method"), "periodic");
}

TEST_F(FrfFile, TheConfidenceRadiusNamesItsVariance) {
  FrfEstimate frf = numbered_frf();
  frf.noise_dof = 4.0;
  frf.total_dof = 2.0;
  write_frf(folder_ / "total.h5", frf);
  const Hdf5File total = Hdf5File::open(folder_ / "total.h5");
  EXPECT_EQ(total.read_text_attribute("/confidence_radius", "of"), "total");
  EXPECT_EQ(total.read_real_attribute("/confidence_radius", "level"), 0.95);
  // F_{2,4;0.95} = 2 (1 / sqrt(0.05) - 1); channel 0 is the first in either order.
  EXPECT_NEAR(total.read_reals("/confidence_radius").front(),
              std::sqrt(6.944271909999157 * frf.total_variance(0, 0)), 1e-9);

  frf.total_variance = Eigen::MatrixXd();
  write_frf(folder_ / "noise.h5", frf);
  EXPECT_EQ(Hdf5File::open(folder_ / "noise.h5").read_text_attribute("/confidence_radius", "of"),
            "noise");
  frf.noise_dof = 0.0;
  write_frf(folder_ / "none.h5", frf);
  EXPECT_FALSE(Hdf5File::open(folder_ / "none.h5").exists("/confidence_radius"));
}

TEST_F(FrfFile, SameContentSameBytes) {
  write_frf(folder_ / "a.h5", numbered_frf());
  write_frf(folder_ / "b.h5", read_frf(folder_ / "a.h5"));
  EXPECT_FALSE(test::read_bytes(folder_ / "a.h5").empty());
  EXPECT_EQ(test::read_bytes(folder_ / "a.h5"), test::read_bytes(folder_ / "b.h5"));
}

/// A file of another program: only the required datasets.
void write_foreign(const fs::path& path, const std::string& leave_out = "") {
  Hdf5File file = Hdf5File::create(path);
  file.write_attribute("/", "format", std::string("stageid-frf"));
  const std::vector<double> frequency = {1.0, 2.0};
  const std::vector<std::complex<double>> response = {{1, 0}, {2, 0}, {3, 0}, {4, 0}};
  if (leave_out != "/frequency_hz") file.write_reals("/frequency_hz", {2}, frequency.data());
  if (leave_out != "/response") file.write_complex("/response", {2, 1, 2}, response.data());
  if (leave_out != "/inputs") file.write_texts("/inputs", {"f1", "f2"});
  if (leave_out != "/outputs") file.write_texts("/outputs", {"x"});
  file.close();
}

TEST_F(FrfFile, FilesWithoutAnythingOptionalAreRead) {
  write_foreign(folder_ / "foreign.h5");
  const FrfEstimate frf = read_frf(folder_ / "foreign.h5");
  EXPECT_EQ(frf.at(1)(0, 1), std::complex<double>(4.0, 0.0));
  EXPECT_EQ(frf.hold, Hold::none);
  EXPECT_EQ(frf.compensated, Compensation::none);
  EXPECT_EQ(frf.inputs.units, (std::vector<std::string>{"1", "1"}));
}

TEST_F(FrfFile, AMissingDatasetIsNamed) {
  for (const char* dataset : {"/frequency_hz", "/response", "/inputs", "/outputs"}) {
    write_foreign(folder_ / "foreign.h5", dataset);
    EXPECT_THAT(read_error("foreign.h5"), AllOf(HasSubstr("foreign.h5"), HasSubstr(dataset)));
  }
}

struct Damage {
  const char* name;
  std::function<void(Hdf5File&)> write;  ///< instead of the valid objects
  const char* message;
};

void write_good(Hdf5File& file) {
  const std::vector<double> frequency = {1.0, 2.0};
  file.write_reals("/frequency_hz", {2}, frequency.data());
  file.write_texts("/inputs", {"a1"});
  file.write_texts("/outputs", {"z1"});
}

/// Two lines of one channel.
void write_response(Hdf5File& file, std::complex<double> second = 2.0) {
  write_good(file);
  const std::complex<double> response[] = {1.0, second};
  file.write_complex("/response", {2, 1, 1}, response);
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const double kTwo[] = {1.0, -2.0};

// All but the first two have the right format.
const Damage kDamages[] = {
    {"NoFormat", [](Hdf5File&) {}, "attribute format is missing"},
    {"OtherFormat",
     [](Hdf5File& f) { f.write_attribute("/", "format", std::string("stageid-log")); },
     "is a log in HDF5, not a frequency response;"},
    {"LaterVersion", [](Hdf5File& f) { f.write_attribute("/", "format_version", 2LL); },
     "unsupported format_version 2; this program reads 1"},
    {"Hold", [](Hdf5File& f) { f.write_attribute("/", "hold", std::string("foh")); },
     "hold is 'foh'"},
    {"Compensated", [](Hdf5File& f) { f.write_attribute("/", "compensated", std::string("yes")); },
     "compensated is 'yes'"},
    {"Count", [](Hdf5File& f) { f.write_attribute("/", "periods", -3LL); }, "periods is -3"},
    {"Shape",
     [](Hdf5File& f) {
       write_good(f);
       const std::complex<double> response[4] = {};
       f.write_complex("/response", {2, 2, 1}, response);
     },
     "/response: shape is [2 x 2 x 1]; expected [2 x 1 x 1]"},
    {"VarianceShape",
     [](Hdf5File& f) {
       write_response(f);
       f.write_reals("/noise_variance", {2}, kTwo);
     },
     "/noise_variance: shape is [2]"},
    {"FrequencyShape",
     [](Hdf5File& f) {
       f.write_reals("/frequency_hz", {1, 2}, kTwo);
       f.write_texts("/inputs", {"a1"});
       f.write_texts("/outputs", {"z1"});
     },
     "/frequency_hz: shape is [1 x 2]"},
    {"NotANumber",
     [](Hdf5File& f) {
       write_response(f, {0.0, kNan});
     },
     ":/response[line 1, z1 <- a1]: not finite"},
    {"NegativeVariance",
     [](Hdf5File& f) {
       write_response(f);
       f.write_reals("/total_variance", {2, 1, 1}, kTwo);
     },
     ":/total_variance[line 1, z1 <- a1]: a variance must be 0 or more"},
    {"Units",
     [](Hdf5File& f) {
       write_response(f);
       f.write_attribute("/inputs", "unit", std::vector<std::string>{"N", "m"});
     },
     ":/inputs: 2 units for 1 channel"},
    {"RealResponse",
     [](Hdf5File& f) {
       write_good(f);
       f.write_reals("/response", {2, 1, 1}, kTwo);
     },
     "/response"},
};

class DamagedFrfFile : public FrfFile, public testing::WithParamInterface<Damage> {};

TEST_P(DamagedFrfFile, IsRefusedByName) {
  Hdf5File file = Hdf5File::create(folder_ / "damaged.h5");
  GetParam().write(file);
  if (!file.has_attribute("/", "format") && GetParam().name != std::string("NoFormat"))
    file.write_attribute("/", "format", std::string("stageid-frf"));
  file.close();
  EXPECT_THAT(read_error("damaged.h5"),
              AllOf(HasSubstr("damaged.h5:"), HasSubstr(GetParam().message)));
}

INSTANTIATE_TEST_SUITE_P(Damages, DamagedFrfFile, testing::ValuesIn(kDamages),
                         [](const auto& damage) { return damage.param.name; });

TEST_F(FrfFile, WhatIsNotThereOrNotHdf5) {
  EXPECT_THROW(read_frf(folder_ / "nothing.h5"), FileError);
  std::ofstream(folder_ / "text.h5") << "frequency,real,imaginary\n";
  EXPECT_THAT(read_error("text.h5"), HasSubstr("text.h5"));
  write_frf(folder_ / "whole.h5", numbered_frf());
  fs::resize_file(folder_ / "whole.h5", fs::file_size(folder_ / "whole.h5") / 2);
  EXPECT_THAT(read_error("whole.h5"), HasSubstr("whole.h5"));
}

TEST_F(FrfFile, ARefusedEstimateLeavesNoFile) {
  FrfEstimate frf = numbered_frf();
  frf.response(0, 0) = {kNan, 0.0};
  EXPECT_THROW(write_frf(folder_ / "bad.h5", frf), std::invalid_argument);
  EXPECT_THROW(write_frf(folder_ / "no/folder/frf.h5", numbered_frf()), FileError);
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

TEST_F(FrfFile, SpoiltDatasetsAreNamed) {
  for (const char* dataset :
       {"/detection_line", "/detection_power", "/detection_noise", "/detection_runs",
        "/detection_linear_power", "/dropped_periods", "/replaced_samples",
        "/left_out_realizations", "/nonlinearity_p_value", "/nonlinearity_settled_p_value",
        "/nonlinearity_even_level"}) {
    write_frf(folder_ / "frf.h5", with_quality());
    test::Hdf5Surgery(folder_ / "frf.h5").reshape(dataset, {7});
    EXPECT_THAT(read_error("frf.h5"), HasSubstr(dataset)) << dataset;
  }
  FrfEstimate frf = with_quality();
  frf.detection.noise(1, 1) = kNan;
  EXPECT_THROW(write_frf(folder_ / "frf.h5", frf), std::invalid_argument);
  frf = with_quality();
  frf.nonlinearity.p_value.resize(6, 1);
  EXPECT_THROW(write_frf(folder_ / "frf.h5", frf), std::invalid_argument);
}

}  // namespace stageid::test_frf_file
