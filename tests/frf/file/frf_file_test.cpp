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
#include "tests/support/models/numbered_frf.hpp"

namespace stageid {
namespace test_frf_file {

using test::numbered_frf;
using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

class FrfFile : public testing::Test {
 protected:
  FrfFile() {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(testing::TempDir()) / (std::string("frf_file_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~FrfFile() override { fs::remove_all(folder_); }

  std::string bytes(const char* name) const {
    std::ifstream in(folder_ / name, std::ios::binary);
    std::ostringstream all;
    all << in.rdbuf();
    return all.str();
  }

  std::string read_error(const char* name) const {
    try {
      read_frf(folder_ / name);
    } catch (const FormatError& error) {
      return error.what();
    } catch (const std::exception& error) {
      return std::string("another kind of error: ") + error.what();
    }
    return "no error";
  }

  fs::path folder_;
};

TEST_F(FrfFile, GivesBackWhatWasWritten) {
  const FrfEstimate frf = numbered_frf();
  write_frf(folder_ / "frf.h5", frf);
  const FrfEstimate back = read_frf(folder_ / "frf.h5");
  EXPECT_EQ(back.frequency_hz, frf.frequency_hz);
  EXPECT_EQ(back.response, frf.response);
  EXPECT_EQ(back.noise_variance, frf.noise_variance);
  EXPECT_EQ(back.total_variance, frf.total_variance);
  EXPECT_EQ(back.covariance, frf.covariance);
  EXPECT_EQ(back.residual_covariance_re, frf.residual_covariance_re);
  EXPECT_EQ(back.input_factor, frf.input_factor);
  EXPECT_EQ(back.residual_covariance_im, frf.residual_covariance_im);
  EXPECT_EQ(back.input_condition, frf.input_condition);
  EXPECT_EQ(back.inputs, frf.inputs);
  EXPECT_EQ(back.outputs, frf.outputs);
  EXPECT_EQ(back.sample_rate_hz, frf.sample_rate_hz);
  EXPECT_EQ(back.hold, frf.hold);
  EXPECT_EQ(back.compensated, frf.compensated);
  EXPECT_EQ(back.delay_s, frf.delay_s);
  EXPECT_EQ(back.realizations, 3);
  EXPECT_EQ(back.periods, 5);
  EXPECT_EQ(back.experiments, 7);
  EXPECT_EQ(back.noise_dof, 84.0);
  EXPECT_EQ(back.total_dof, 2.0);
  EXPECT_EQ(back.excluded_channels, frf.excluded_channels);
  EXPECT_EQ(back.excluded_power, frf.excluded_power);
  EXPECT_EQ(back.provenance_json, frf.provenance_json);
}

TEST_F(FrfFile, WhatIsUnknownStaysUnknown) {
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd::Constant(1, 2.0);
  frf.inputs = {{"a"}, {"N"}};
  frf.outputs = {{"z"}, {"m"}};
  frf.response = Eigen::MatrixXcd::Constant(1, 1, {1.0, 2.0});
  write_frf(folder_ / "frf.h5", frf);
  const FrfEstimate back = read_frf(folder_ / "frf.h5");
  EXPECT_EQ(back.response, frf.response);
  EXPECT_EQ(back.noise_variance.size(), 0);
  EXPECT_EQ(back.total_variance.size(), 0);
  EXPECT_EQ(back.covariance.size(), 0);
  EXPECT_EQ(back.input_condition.size(), 0);
  EXPECT_TRUE(back.excluded_channels.empty());
  EXPECT_EQ(back.hold, Hold::none);
  EXPECT_EQ(back.sample_rate_hz, 0.0);
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
  EXPECT_FALSE(bytes("a.h5").empty());
  EXPECT_EQ(bytes("a.h5"), bytes("b.h5"));
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

const std::complex<double> kTwo[] = {{1.0, 0.0}, {2.0, 0.0}, {3.0, 0.0}, {4.0, 0.0}};
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

const Damage kDamages[] = {
    {"NoFormat", [](Hdf5File&) {}, "attribute format is missing"},
    {"OtherFormat",
     [](Hdf5File& f) { f.write_attribute("/", "format", std::string("stageid-log")); },
     "is a log in HDF5, not a frequency response;"},
    {"LaterVersion",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       f.write_attribute("/", "format_version", 2LL);
     },
     "unsupported format_version 2; this program reads 1"},
    {"Hold",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       f.write_attribute("/", "hold", std::string("foh"));
     },
     "hold is 'foh'"},
    {"Compensated",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       f.write_attribute("/", "compensated", std::string("yes"));
     },
     "compensated is 'yes'"},
    {"Count",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       f.write_attribute("/", "periods", -3LL);
     },
     "periods is -3"},
    {"Shape",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       write_good(f);
       f.write_complex("/response", {2, 2, 1}, kTwo);
     },
     "/response: shape is [2 x 2 x 1]; expected [2 x 1 x 1]"},
    {"VarianceShape",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       write_good(f);
       f.write_complex("/response", {2, 1, 1}, kTwo);
       const double variance[] = {1.0, 2.0};
       f.write_reals("/noise_variance", {2}, variance);
     },
     "/noise_variance: shape is [2]"},
    {"FrequencyShape",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       const double frequency[] = {1.0, 2.0};
       f.write_reals("/frequency_hz", {1, 2}, frequency);
       f.write_texts("/inputs", {"a1"});
       f.write_texts("/outputs", {"z1"});
     },
     "/frequency_hz: shape is [1 x 2]"},
    {"NotANumber",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       write_good(f);
       const std::complex<double> response[] = {{1.0, 0.0}, {0.0, kNan}};
       f.write_complex("/response", {2, 1, 1}, response);
     },
     ":/response[line 1, z1 <- a1]: not finite"},
    {"NegativeVariance",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       write_good(f);
       f.write_complex("/response", {2, 1, 1}, kTwo);
       const double variance[] = {1.0, -2.0};
       f.write_reals("/total_variance", {2, 1, 1}, variance);
     },
     ":/total_variance[line 1, z1 <- a1]: a variance must be 0 or more"},
    {"Units",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       write_good(f);
       f.write_attribute("/inputs", "unit", std::vector<std::string>{"N", "m"});
       f.write_complex("/response", {2, 1, 1}, kTwo);
     },
     ":/inputs: 2 units for 1 channel"},
    {"RealResponse",
     [](Hdf5File& f) {
       f.write_attribute("/", "format", std::string("stageid-frf"));
       write_good(f);
       const double response[] = {1.0, 2.0};
       f.write_reals("/response", {2, 1, 1}, response);
     },
     "/response"},
};

class DamagedFrfFile : public FrfFile, public testing::WithParamInterface<Damage> {};

TEST_P(DamagedFrfFile, IsRefusedByName) {
  Hdf5File file = Hdf5File::create(folder_ / "damaged.h5");
  GetParam().write(file);
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
  EXPECT_THROW(write_frf(folder_ / "no" / "folder" / "frf.h5", numbered_frf()), FileError);
  EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace test_frf_file
}  // namespace stageid
