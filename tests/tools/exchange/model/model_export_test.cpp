#include "tools/exchange/model/model_export.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/input_files.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_model_export {

AdditiveModel small_model() {
  AdditiveModel model;
  model.inputs = {{"a,1", "a2", "a3"}, {"N", "N", "Nm"}};
  model.outputs = {{"y1", "y2"}, {"m", "m"}};
  model.sample_rate_hz = 1000.0;
  model.hold = HoldModel::sinc;
  model.input_delay_s = Eigen::VectorXd{{1e-3, 2e-3, 3e-3}};
  model.output_delay_s = Eigen::VectorXd{{0.0, 1e-4}};
  Submodel rigid;
  rigid.integrators = 2;
  rigid.numerator = {Eigen::MatrixXd{{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}}};
  Submodel mode;
  mode.denominator = {1.0, 1e-4, 1e-5};
  mode.numerator = {Eigen::MatrixXd{{.1, .2, .3}, {.4, .5, .6}},
                    Eigen::MatrixXd{{7.0, 8.0, 9.0}, {10.0, 11.0, 12.0}}};
  mode.natural_frequency_std_hz = 0.25;
  model.submodels = {rigid, mode};
  return model;
}

TEST(ModelExport, Hdf5HoldsWhatTheModelHolds) {
  const test::TemporaryDirectory directory;
  const AdditiveModel model = small_model();
  const ExportedResponse exported = {
      Eigen::VectorXd{{5.0, 10.0}},
      Eigen::MatrixXd{{1, 7}, {2, 8}, {3, 9}, {4, 10}, {5, 11}, {6, 12}}};
  export_model(directory / "m.h5", model, exported);
  const Hdf5File file = Hdf5File::open(directory / "m.h5");
  EXPECT_EQ(file.read_text_attribute("/", "format"), "stageid-model");
  EXPECT_EQ(file.read_texts("/inputs"), model.inputs.names);
  EXPECT_EQ(file.shape("/submodels/0001/numerator"), (std::vector<hsize_t>{2, 2, 3}));
  const std::vector<double> numerator = file.read_reals("/submodels/0001/numerator");
  EXPECT_EQ(numerator[1], 0.2);   // power 0, y1 <- a2
  EXPECT_EQ(numerator[9], 10.0);  // power 1, y2 <- a1
  EXPECT_EQ(file.read_reals("/modes/natural_frequency_std_hz"), std::vector<double>{0.25});
  EXPECT_EQ(file.read_reals("/modes/natural_frequency_hz").at(0),
            model.submodels[1].natural_frequency_hz());
  const Eigen::MatrixXcd P = response(model, exported.frequency_hz, model.hold);
  const std::vector<std::complex<double>> stored = file.read_complex("/response");
  EXPECT_EQ(file.shape("/response"), (std::vector<hsize_t>{2, 2, 3}));
  EXPECT_EQ(stored[1], P(2, 0));  // line 0, y1 <- a2
  EXPECT_EQ(stored[9], P(1, 1));  // line 1, y2 <- a1
  EXPECT_EQ(read_response_variance(directory / "m.h5", exported.frequency_hz), exported.variance);
  EXPECT_EQ(read_response_variance(directory / "m.h5", Eigen::VectorXd{{5.0, 11.0}}).size(), 0);
  // The text inside is the model file.
  export_model(directory / "m.json", model, {});
  EXPECT_EQ(file.read_texts("/model_json").at(0), read_whole_file(directory / "m.json"));
}

TEST(ModelExport, CsvHasOneLineACoefficient) {
  const test::TemporaryDirectory directory;
  export_model(directory / "m.csv", small_model(), {});
  std::istringstream text(read_whole_file(directory / "m.csv"));
  std::string line;
  std::vector<std::string> lines;
  while (std::getline(text, line))
    if (line[0] != '#') lines.push_back(line);
  ASSERT_EQ(lines.size(), 1U + 6U + 12U);
  EXPECT_EQ(lines[1], "0,2,,,,,0,y1,\"a,1\",1");
  EXPECT_THAT(lines[7],
              testing::MatchesRegex("1,0,50\\.3[0-9]*,0\\.25,[0-9.]+,,0,y1,\"a,1\",0\\.1"));
  EXPECT_THAT(lines.back(), testing::EndsWith(",1,y2,a3,12"));
}

TEST(ModelExport, WhatAFormatCannotHoldIsRefused) {
  const test::TemporaryDirectory directory;
  AdditiveModel model = small_model();
  EXPECT_THROW(export_model(directory / "m.step", model, {}), std::invalid_argument);
  EXPECT_THROW(require_export_format("m"), std::invalid_argument);
  model.submodels[1].denominator = {1.0, 1.0, 1.0, 1.0};
  EXPECT_THROW(export_model(directory / "m.csv", model, {}), std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(directory / "m.csv"));
  EXPECT_THROW(export_model(directory / "none" / "m.h5", model, {}), FileError);
}

TEST(ModelExport, LeavesNothingBesideItsFile) {
  const test::TemporaryDirectory directory;
  export_model(directory / "m.h5", small_model(), {});
  const std::filesystem::directory_iterator files(directory.path());
  EXPECT_EQ(std::distance(begin(files), end(files)), 1);
}

}  // namespace stageid::test_model_export
