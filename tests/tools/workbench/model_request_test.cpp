#include "tools/workbench/model_request.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "estimation/request/request_flags.hpp"

namespace stageid::test_model_request {

Submodel mode(double frequency_hz, double damping_ratio, std::size_t numerators = 1) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  Submodel s;
  s.denominator = {1.0, 2.0 * damping_ratio / omega, 1.0 / (omega * omega)};
  s.numerator.assign(numerators, Eigen::MatrixXd::Ones(1, 1));
  return s;
}

AdditiveModel model_of(std::vector<Submodel> submodels) {
  AdditiveModel model;
  model.inputs = {{"u"}, {"N"}};
  model.outputs = {{"y"}, {"m"}};
  model.submodels = std::move(submodels);
  return model;
}

Submodel rigid_body() { return {2, {1.0}, {Eigen::MatrixXd::Ones(1, 1)}, {}, {}}; }
Submodel direct_term() { return {0, {1.0}, {Eigen::MatrixXd::Ones(1, 1)}, {}, {}}; }

std::string flags_of_model(const AdditiveModel& model, const FitRequest& request = {}) {
  return flags_of(with_modes_of(model, request, 5.0)).dump();
}

TEST(ModelRequest, ReadsTheFlagsOfTheProvenance) {
  AdditiveModel model = model_of({});
  FitRequest request;
  request.band_hz = {20.0, 800.5};
  request.modes = {ModesRequest::Kind::given, 0, {{100.5, 0.01}, {200.0, 0.02}}};
  request.weighting = Weighting::total_variance;
  request.delay = DelayRequest{DelayModel::fixed, 1.25e-4};
  request.rigid_body = {RigidBodyRequest::Kind::suspension, 0, {0.4, 0.5}};
  request.residue_rank = 1;
  request.general_damping = false;
  request.direct_term = true;
  request.max_iterations = 50;
  model.provenance_json =
      nlohmann::ordered_json{
          {"options",
           {{"flags", flags_of(request)}, {"max_iterations", 50}, {"search_seconds", 180.0}}}}
          .dump();
  EXPECT_EQ(flags_of(request_of(model)), flags_of(request));
}

TEST(ModelRequest, AForeignModelHasTheDefaults) {
  AdditiveModel model = model_of({});
  for (const char* json :
       {"{}", "[]", "nonsense", R"({"options": 3})", R"({"options": {"flags": []}})"}) {
    model.provenance_json = json;
    EXPECT_EQ(flags_of(request_of(model)).dump(), "{}") << json;
  }
}

TEST(ModelRequest, AForeignModelNamesNoFileElsewhere) {
  AdditiveModel model = model_of({});
  model.provenance_json =
      R"({"options": {"flags": {"--modes": "/etc/passwd", "--weighting": "/somewhere/w.h5"}}})";
  const FitRequest request = request_of(model);
  EXPECT_EQ(request.modes.kind, ModesRequest::Kind::by_submodels);
  EXPECT_EQ(request.weight_file, "w.h5");
}

TEST(ModelRequest, TakesModesAndStructureOfTheModel) {
  EXPECT_EQ(
      flags_of_model(model_of({rigid_body(), mode(200.123456789, 0.0123456), mode(100.0, 0.01)})),
      R"({"--modes":"100,200.1235:0.01235","--rigid-body":"full","--damping":"proportional","--direct-term":"none"})");
  EXPECT_EQ(
      flags_of_model(model_of({direct_term(), mode(100.0, 0.01, 2)})),
      R"({"--modes":"100,","--rigid-body":"none","--damping":"general","--direct-term":"full"})");
}

TEST(ModelRequest, KeepsWhatWasRequested) {
  FitRequest request;
  request.rigid_body = {RigidBodyRequest::Kind::suspension, 0, {}};
  request.direct_term = false;
  request.general_damping = true;
  EXPECT_EQ(
      flags_of_model(model_of({mode(1.0, 0.1), mode(100.0, 0.01)}), request),
      R"({"--modes":"100,","--rigid-body":"suspension","--damping":"general","--direct-term":"none"})")
      << "the mode below the lines is that of the suspension";
}

TEST(ModelRequest, DifferentDelaysArePerChannel) {
  AdditiveModel model = model_of({mode(100.0, 0.01)});
  model.inputs = {{"u", "v"}, {"N", "N"}};
  model.input_delay_s = Eigen::Vector2d(1e-4, 1e-4);
  EXPECT_THAT(flags_of_model(model), testing::Not(testing::HasSubstr("--delay")));
  model.input_delay_s[1] = 2e-4;
  EXPECT_THAT(flags_of_model(model), testing::HasSubstr(R"("--delay":"per_channel")"));
}

TEST(ModelRequest, RefusesRequestedSubmodels) {
  FitRequest request;
  request.submodels.emplace_back();
  EXPECT_THAT([&] { with_modes_of(model_of({}), request, 1.0); },
              testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("--submodel")));
}

}  // namespace stageid::test_model_request
