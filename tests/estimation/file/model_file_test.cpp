#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>
#include <tuple>

#include "acquisition/files/file_error.hpp"
#include "estimation/model/additive_model.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/file_bytes.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_model_file {

using Json = nlohmann::ordered_json;
using testing::AllOf;
using testing::HasSubstr;

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
    test::write_bytes(file_, Json::parse(test::read_bytes(file_)).patch(patch).dump());
    EXPECT_THAT(read_error(), AllOf(HasSubstr(place), HasSubstr(what))) << operation;
  }

  /// One line that names the file.
  std::string read_error() const {
    const std::string message = test::error_message<FormatError>([this] { read_model(file_); });
    EXPECT_THAT(message, AllOf(HasSubstr(file_.string()), testing::Not(HasSubstr("\n"))));
    return message;
  }

  test::TemporaryDirectory directory_;
  std::filesystem::path file_ = directory_ / "model.json";
};

TEST_F(ModelFile, RoundTripsEveryBit) {
  AdditiveModel model = full_model();
  model.submodels[0].poles = {
      {30.0, 1.0, 0.5, {}}, {120.0, 0.01, {}, {}}, {180.0, 0.02, 0.01, 1e-4}};
  write_model(file_, model);
  const AdditiveModel read = read_model(file_);
  const auto channels = [](const AdditiveModel& m) {
    return std::tie(m.inputs, m.outputs, m.sample_rate_hz, m.hold, m.cost_history);
  };
  EXPECT_TRUE(channels(read) == channels(model));
  const auto delays = [](const AdditiveModel& m) {
    return std::tie(m.input_delay_s, m.output_delay_s, m.input_delay_std_s, m.output_delay_std_s);
  };
  EXPECT_TRUE(delays(read) == delays(model));
  const auto fit = [](const FitRecord& s) {
    return std::tie(s.cost, s.weighting, s.iterations, s.status, s.message, s.relative_rms_error,
                    s.band_hz[0], s.band_hz[1]);
  };
  EXPECT_TRUE(fit(read.fit) == fit(model.fit));
  EXPECT_EQ(Json::parse(read.provenance_json), Json::parse(model.provenance_json));
  const auto submodel = [](const Submodel& s) {
    return std::tie(s.integrators, s.denominator, s.numerator, s.natural_frequency_std_hz,
                    s.damping_ratio_std, s.residue_rank, s.verdict, s.numerator_std);
  };
  const auto pole = [](const PoleEstimate& p) {
    return std::tie(p.natural_frequency_hz, p.damping_ratio, p.natural_frequency_std_hz,
                    p.damping_ratio_std);
  };
  ASSERT_EQ(read.submodels.size(), model.submodels.size());
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    EXPECT_TRUE(submodel(read.submodels[i]) == submodel(model.submodels[i])) << i;
    EXPECT_TRUE(
        std::ranges::equal(read.submodels[i].poles, model.submodels[i].poles, {}, pole, pole))
        << i;
  }
}

// The fields that other programs rely on, docs/formats.md.
TEST_F(ModelFile, HasTheFieldsOfTheContract) {
  const AdditiveModel model = full_model();
  write_model(file_, model);
  const Json root = Json::parse(test::read_bytes(file_));
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
  auto fit = nlohmann::json::parse(root["fit"].dump());  // in any order
  EXPECT_EQ(fit.erase("seconds"), 1U);
  EXPECT_EQ(fit, nlohmann::json({{"cost", 1.0 / 7.0},
                                 {"weighting", "noise_variance"},
                                 {"iterations", 12},
                                 {"status", "unexplained"},
                                 {"message", "the residual is 5 times the noise"},
                                 {"relative_rms_error", 0.01 / 3.0},
                                 {"band_hz", {20.25, 1999.75}}}));
}

TEST_F(ModelFile, OfAnotherProgramMayLackWhatIsNotNeeded) {
  test::write_bytes(file_, R"({"format": "stageid-model", "inputs": ["u"], "outputs": ["y"],
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

TEST_F(ModelFile, WithoutItsFileOrDirectoryIsAFileErrorAndLeavesNothing) {
  EXPECT_THAT(test::error_message<FileError>([this] { read_model(directory_ / "no.json"); }),
              HasSubstr("no.json"));
  EXPECT_THROW(write_model(directory_ / "no" / "model.json", full_model()), FileError);
  EXPECT_TRUE(std::filesystem::is_empty(directory_.path()));
  write_model(file_, full_model());
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_.path()), {}), 1);
}

TEST_F(ModelFile, CutShortAnywhereOrNotOfThisFormatIsAFormatError) {
  write_model(file_, full_model());
  const std::string whole = test::read_bytes(file_);
  for (std::size_t length = 0; length + 2 < whole.size(); length += 97) {
    SCOPED_TRACE(length);
    test::write_bytes(file_, whole.substr(0, length));
    read_error();
  }
  for (const char* text :
       {"{]", "\xff\xfe", "[1, 2]", "3", "{}", R"({"format": "stageid-modes"})", R"({"format": 1})",
        R"({"format": "stageid-model", "inputs": [1e999]})"}) {
    SCOPED_TRACE(text);
    test::write_bytes(file_, text);
    read_error();
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
