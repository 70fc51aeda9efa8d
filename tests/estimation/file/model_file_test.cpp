#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "acquisition/files/file_error.hpp"
#include "estimation/model/additive_model.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test_model_file {

using Json = nlohmann::ordered_json;
using testing::AllOf;
using testing::HasSubstr;

std::string text_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::stringstream text;
  text << stream.rdbuf();
  return text.str();
}

void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

/// A model with everything in it, numbers without a short decimal form.
AdditiveModel full_model() {
  test::RandomNumbers random(4);
  AdditiveModel model = test::named_model(2, 3);
  model.inputs.units = {"N", "N", "V"};
  model.sample_rate_hz = 1e4 / 3.0;
  model.hold = HoldModel::exact;
  for (double& value : model.input_delay_s) value = 1e-4 * random.uniform();
  for (double& value : model.output_delay_s) value = -1e-5 * random.uniform();
  model.input_delay_std_s = model.input_delay_s / 3.0;
  model.output_delay_std_s = -model.output_delay_s / 3.0;
  model.submodels = {test::empty_submodel(model, 2, {}, 1),
                     test::empty_submodel(model, 0, {1.0 / 30000.0, 1.0 / 9e8}, 2),
                     test::empty_submodel(model, 1, {0.1, 0.01, 0.001 / 3.0}, 1),
                     test::empty_submodel(model, 0, {}, 1)};
  for (Submodel& s : model.submodels)
    for (Eigen::MatrixXd& B : s.numerator)
      for (double& value : B.reshaped()) value = random.normal() * 1e-7;
  model.submodels[1].natural_frequency_std_hz = 0.1 / 3.0;
  model.submodels[1].damping_ratio_std = 1e-5 / 3.0;
  model.submodels[1].residue_rank = 1;
  model.submodels[1].verdict = ModeVerdict::weak;
  for (const Eigen::MatrixXd& B : model.submodels[1].numerator)
    model.submodels[1].numerator_std.push_back(B.cwiseAbs() / 3.0);
  model.fit = {
      1.0 / 7.0,  "noise_variance", 12, FitStatus::unexplained, "the residual is 5 times the noise",
      0.01 / 3.0, {20.25, 1999.75}, 0.0};
  model.cost_history = {3.0, 1.0 / 3.0, 1.0 / 7.0};
  model.provenance_json = R"({"zulu":1,"inputs":{"b.h5":"1234","a.h5":"5678"}})";
  return model;
}

struct ModelFile : testing::Test {
  /// Reads a good file after an operation of a JSON patch.
  void expect_patch_refused(const std::string& operation, const std::string& place,
                            const std::string& what) {
    write_model(file_, full_model());
    const Json patch = Json::array({Json::parse(operation)});
    write_text(file_, Json::parse(text_of(file_)).patch(patch).dump());
    EXPECT_THAT(
        [this] { (void)read_model(file_); },
        testing::ThrowsMessage<FormatError>(AllOf(HasSubstr(file_.string()), HasSubstr(place),
                                                  HasSubstr(what), testing::Not(HasSubstr("\n")))))
        << operation;
  }

  test::TemporaryDirectory directory_;
  std::filesystem::path file_ = directory_ / "model.json";
};

TEST_F(ModelFile, RoundTripsEveryBit) {
  const AdditiveModel model = full_model();
  write_model(file_, model);
  const AdditiveModel read = read_model(file_);
  EXPECT_EQ(read.inputs, model.inputs);
  EXPECT_EQ(read.outputs, model.outputs);
  EXPECT_EQ(read.sample_rate_hz, model.sample_rate_hz);
  EXPECT_EQ(read.hold, model.hold);
  EXPECT_EQ(read.input_delay_s, model.input_delay_s);
  EXPECT_EQ(read.output_delay_s, model.output_delay_s);
  EXPECT_EQ(read.input_delay_std_s, model.input_delay_std_s);
  EXPECT_EQ(read.output_delay_std_s, model.output_delay_std_s);
  ASSERT_EQ(read.submodels.size(), model.submodels.size());
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Submodel& a = read.submodels[i];
    const Submodel& b = model.submodels[i];
    EXPECT_EQ(a.integrators, b.integrators);
    EXPECT_EQ(a.denominator, b.denominator);
    EXPECT_EQ(a.numerator, b.numerator);
    EXPECT_EQ(a.natural_frequency_std_hz, b.natural_frequency_std_hz);
    EXPECT_EQ(a.damping_ratio_std, b.damping_ratio_std);
    EXPECT_EQ(a.residue_rank, b.residue_rank);
    EXPECT_EQ(a.verdict, b.verdict);
    EXPECT_EQ(a.numerator_std, b.numerator_std);
  }
  EXPECT_EQ(read.fit.cost, model.fit.cost);
  EXPECT_EQ(read.fit.weighting, model.fit.weighting);
  EXPECT_EQ(read.fit.iterations, model.fit.iterations);
  EXPECT_EQ(read.fit.status, model.fit.status);
  EXPECT_EQ(read.fit.message, model.fit.message);
  EXPECT_EQ(read.fit.relative_rms_error, model.fit.relative_rms_error);
  EXPECT_EQ(read.fit.band_hz[0], model.fit.band_hz[0]);
  EXPECT_EQ(read.fit.band_hz[1], model.fit.band_hz[1]);
  EXPECT_EQ(read.cost_history, model.cost_history);
  EXPECT_EQ(Json::parse(read.provenance_json), Json::parse(model.provenance_json));
}

TEST_F(ModelFile, KeepsThePolesOfASubmodelThatIsNoMode) {
  AdditiveModel model = full_model();
  Submodel& s = model.submodels[0];
  s.poles = {{30.0, 1.0, 0.5, {}}, {120.0, 0.01, {}, {}}, {180.0, 0.02, 0.01, 1e-4}};
  write_model(file_, model);
  const std::vector<PoleEstimate> poles = read_model(file_).submodels[0].poles;
  ASSERT_EQ(poles.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(poles[i].natural_frequency_hz, s.poles[i].natural_frequency_hz);
    EXPECT_EQ(poles[i].damping_ratio, s.poles[i].damping_ratio);
    EXPECT_EQ(poles[i].natural_frequency_std_hz, s.poles[i].natural_frequency_std_hz);
    EXPECT_EQ(poles[i].damping_ratio_std, s.poles[i].damping_ratio_std);
  }
}

TEST_F(ModelFile, WrittenAgainIsTheSameFile) {
  write_model(file_, full_model());
  const std::filesystem::path again = directory_ / "again.json";
  write_model(again, read_model(file_));
  EXPECT_EQ(text_of(again), text_of(file_));
}

// The fields that other programs rely on, docs/formats.md.
TEST_F(ModelFile, HasTheFieldsOfTheContract) {
  const AdditiveModel model = full_model();
  write_model(file_, model);
  const Json root = Json::parse(text_of(file_));
  EXPECT_EQ(root["format"], "stageid-model");
  EXPECT_EQ(root["format_version"], 1);
  EXPECT_EQ(root["inputs"], Json({"a1", "a2", "a3"}));
  EXPECT_EQ(root["outputs"], Json({"z1", "z2"}));
  EXPECT_EQ(root["sample_rate_hz"].get<double>(), model.sample_rate_hz);
  EXPECT_EQ(root["hold"], "exact");
  EXPECT_EQ(root["input_delay_s"].size(), 3U);
  EXPECT_EQ(root["output_delay_s"].size(), 2U);
  ASSERT_EQ(root["submodels"].size(), 4U);
  const Json& rigid = root["submodels"][0];
  EXPECT_EQ(rigid["integrators"], 2);
  EXPECT_EQ(rigid["denominator"], Json::array({1.0}));
  EXPECT_FALSE(rigid.contains("natural_frequency_hz"));
  const Json& mode = root["submodels"][1];
  EXPECT_EQ(mode["integrators"], 0);
  EXPECT_EQ(mode["denominator"].size(), 3U);
  // power of s, then output, then input
  ASSERT_EQ(mode["numerator"].size(), 2U);
  ASSERT_EQ(mode["numerator"][0].size(), 2U);
  ASSERT_EQ(mode["numerator"][0][0].size(), 3U);
  EXPECT_EQ(mode["numerator"][1][1][2].get<double>(), model.submodels[1].numerator[1](1, 2));
  // a_1 = 1/30000, a_2 = 1/9e8: 30000 rad/s, damping 0.5
  EXPECT_NEAR(mode["natural_frequency_hz"].get<double>(), 30000.0 / (2.0 * std::numbers::pi), 1e-9);
  EXPECT_NEAR(mode["damping_ratio"].get<double>(), 0.5, 1e-12);
  EXPECT_EQ(mode["natural_frequency_std_hz"].get<double>(), 0.1 / 3.0);
  EXPECT_EQ(mode["damping_ratio_std"].get<double>(), 1e-5 / 3.0);
  EXPECT_EQ(mode["numerator_std"][1][1][2].get<double>(),
            model.submodels[1].numerator_std[1](1, 2));
  EXPECT_FALSE(rigid.contains("numerator_std")) << "unknown";
  const Json& fit = root["fit"];
  EXPECT_EQ(fit["cost"].get<double>(), 1.0 / 7.0);
  EXPECT_EQ(fit["weighting"], "noise_variance");
  EXPECT_EQ(fit["iterations"], 12);
  EXPECT_EQ(fit["status"], "unexplained");
  EXPECT_EQ(fit["message"], "the residual is 5 times the noise");
  EXPECT_EQ(fit["relative_rms_error"].get<double>(), 0.01 / 3.0);
  EXPECT_EQ(fit["band_hz"], Json({20.25, 1999.75}));
  EXPECT_TRUE(fit.contains("seconds"));
}

TEST_F(ModelFile, OfAnotherProgramMayLackWhatIsNotNeeded) {
  write_text(file_, R"({"format": "stageid-model", "inputs": ["u"], "outputs": ["y"],
    "submodels": [{"integrators": 0, "denominator": [1, 0.001, 1e-6], "numerator": [[[2.5]]]}]})");
  const AdditiveModel model = read_model(file_);
  EXPECT_EQ(model.hold, HoldModel::none);
  EXPECT_EQ(model.sample_rate_hz, 0.0);
  EXPECT_EQ(model.input_delay_s, Eigen::VectorXd::Zero(1));
  EXPECT_EQ(model.output_delay_s, Eigen::VectorXd::Zero(1));
  EXPECT_EQ(model.submodels[0].numerator[0](0, 0), 2.5);
  EXPECT_FALSE(model.submodels[0].natural_frequency_std_hz.has_value());
}

TEST_F(ModelFile, DelaysThatWereNeverSetAreWrittenAsZero) {
  AdditiveModel model = full_model();
  model.input_delay_s.resize(0);
  model.output_delay_s.resize(0);
  write_model(file_, model);
  EXPECT_EQ(read_model(file_).input_delay_s, Eigen::VectorXd::Zero(3));
  EXPECT_EQ(read_model(file_).output_delay_s, Eigen::VectorXd::Zero(2));
}

TEST_F(ModelFile, EveryHoldIsReadAsWritten) {
  for (const HoldModel hold :
       {HoldModel::none, HoldModel::phase, HoldModel::sinc, HoldModel::exact}) {
    AdditiveModel model = full_model();
    model.hold = hold;
    write_model(file_, model);
    EXPECT_EQ(read_model(file_).hold, hold);
  }
}

// Refusals ---------------------------------------------------------------------------------------

TEST_F(ModelFile, ThatIsNotThereIsAFileError) {
  EXPECT_THAT([this] { (void)read_model(directory_ / "no.json"); },
              testing::ThrowsMessage<FileError>(HasSubstr("no.json")));
}

TEST_F(ModelFile, IntoADirectoryThatIsNotThereIsAFileErrorAndLeavesNothing) {
  const std::filesystem::path target = directory_ / "no" / "model.json";
  EXPECT_THROW(write_model(target, full_model()), FileError);
  EXPECT_FALSE(std::filesystem::exists(target.parent_path()));
}

TEST_F(ModelFile, LeavesNoTemporaryFile) {
  write_model(file_, full_model());
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_.path()), {}), 1);
}

TEST_F(ModelFile, CutShortAnywhereIsAFormatError) {
  write_model(file_, full_model());
  const std::string whole = text_of(file_);
  for (std::size_t length = 0; length + 2 < whole.size(); length += 97) {
    write_text(file_, whole.substr(0, length));
    EXPECT_THAT([this] { (void)read_model(file_); },
                testing::ThrowsMessage<FormatError>(
                    AllOf(HasSubstr(file_.string()), testing::Not(HasSubstr("\n")))))
        << length;
  }
}

TEST_F(ModelFile, WhatIsNotJsonOrNotOfThisFormat) {
  for (const char* text :
       {"{]", "\xff\xfe", "[1, 2]", "3", "{}", R"({"format": "stageid-modes"})", R"({"format": 1})",
        R"({"format": "stageid-model", "inputs": [1e999]})"}) {
    write_text(file_, text);
    EXPECT_THAT([this] { (void)read_model(file_); },
                testing::ThrowsMessage<FormatError>(HasSubstr(file_.string())))
        << text;
  }
}

TEST_F(ModelFile, FaultsAreNamedWithTheirPlace) {
  const auto remove = [](const std::string& path) {
    return R"({"op": "remove", "path": ")" + path + "\"}";
  };
  for (const char* key : {"inputs", "outputs", "submodels"})
    expect_patch_refused(remove(std::string("/") + key), "/", key);
  for (const char* key : {"integrators", "denominator", "numerator"})
    expect_patch_refused(remove(std::string("/submodels/1/") + key), "/submodels/1", key);
  const auto replace = [](const std::string& path, const std::string& value) {
    return R"({"op": "replace", "path": ")" + path + R"(", "value": )" + value + "}";
  };
  struct Fault {
    std::string path;
    const char* value;  ///< null: NaN and infinity, as JSON has them
    const char* what;
  };
  for (const Fault& fault : std::vector<Fault>{
           {"/format_version", "2", "is 2; must be 1"},
           {"/format_version", "\"1\"", "whole number"},
           {"/submodels/1/numerator/0/1/2", "null", "number"},
           {"/submodels/1/denominator/1", "null", "number"},
           {"/input_delay_s/0", "\"fast\"", "number"},
           {"/sample_rate_hz", "-1.0", "must be 0 or more"},
           {"/fit/cost", "\"low\"", "number"},
           {"/cost_history/1", "null", "number"},
           {"/submodels/0/numerator", "1.0", "list"},
           {"/submodels/0/numerator", "[]", "at least one"},
           {"/submodels/0", "\"mode\"", "object"},
           {"/submodels/0/numerator/0", "[[1, 2, 3]]", "2 rows"},
           {"/submodels/0/numerator/0/1", "[1, 2]", "3 numbers"},
           {"/input_delay_s", "[0, 0, 0, 0]", "3 numbers"},
           {"/output_delay_s", "[0]", "2 numbers"},
           {"/inputs", "[]", "at least one"},
           {"/inputs/1", "7", "string"},
           {"/fit/band_hz", "[1.0]", "two"},
           {"/fit/status", "\"perfect\"", "gradient_small, step_small"},
           {"/submodels/1/denominator", "[2.0, 0.1, 0.1]", "start with 1"},
           {"/submodels/1/denominator", "[]", "start with 1"},
           {"/submodels/1/denominator", "[1, 0.1, 0]", "end with 0"},
           {"/submodels/1/natural_frequency_hz", "1e3", "contradicts \"denominator\""},
           {"/submodels/1/damping_ratio", "0.6", "contradicts \"denominator\""},
           {"/submodels/1/integrators", "3", "0 to 2"},
           {"/submodels/1/integrators", "0.5", "whole number"},
           {"/submodels/3/numerator", "[[[1, 2, 3], [4, 5, 6]], [[1, 2, 3], [4, 5, 6]]]",
            "improper"},
           {"/hold", "\"first-order\"", "none, phase, sinc or exact"},
           {"/output_delay_std_s", "[1e-6, -1e-6]", "negative standard deviation"},
           {"/submodels/1/numerator_std", "[[[1, 2, 3], [4, 5, 6]]]", "as many matrices as"},
           {"/submodels/1/numerator_std/0", "[[1, 2, 3], [4, 5, -1]]",
            "negative standard deviation"},
           {"/submodels/1/numerator_std/0", "[[1, 2, 3]]", "2 rows"}})
    expect_patch_refused(replace(fault.path, fault.value), fault.path, fault.what);
}

TEST_F(ModelFile, NamesThatAreNotUtf8AreWrittenReadably) {
  AdditiveModel model = full_model();
  model.inputs.units[0] = "\xb5m";  // Latin-1, as old files hold it
  ASSERT_NO_THROW(write_model(file_, model));
  EXPECT_NO_THROW((void)read_model(file_));
}

}  // namespace stageid::test_model_file
