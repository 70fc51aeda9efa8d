#include "estimation/request/fit_request.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <complex>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "estimation/model/cmif.hpp"
#include "estimation/problem/weight_matrices.hpp"
#include "estimation/request/submodel_text.hpp"
#include "frf/response/hold_compensation.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_fit_request {

using testing::HasSubstr;

/// One output, two inputs, four lines, measured through a hold.
FrfEstimate measured() {
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd{{10.0, 20.0, 30.0, 40.0}};
  frf.inputs = {{"a", "b"}, {"N", "N"}};
  frf.outputs = {{"y"}, {"m"}};
  frf.response = Eigen::MatrixXcd::NullaryExpr(2, 4, [](Eigen::Index channel, Eigen::Index line) {
    return std::polar(1.0 + static_cast<double>(channel), 0.7 * static_cast<double>(line));
  });
  frf.noise_variance = Eigen::MatrixXd::Constant(2, 4, 0.25);
  frf.sample_rate_hz = 1000.0;
  frf.hold = Hold::zoh;
  return frf;
}

FrfEstimate without_variances() {
  FrfEstimate frf = measured();
  frf.noise_variance.resize(0, 0);
  return frf;
}

/// The message of a refusal.
std::string error_of(const FitRequest& request, const FrfEstimate& frf = measured()) {
  return test::error_message<std::invalid_argument>([&] { make_fit_setup(request, frf); });
}

TEST(FitRequest, AMeasuredResponseIsFittedExactlyWithEstimatedDelay) {
  const FitSetup setup = make_fit_setup({}, measured());
  EXPECT_EQ(setup.options.hold, HoldModel::exact);
  EXPECT_EQ(setup.options.delay, DelayModel::estimate);
  EXPECT_EQ(setup.options.weighting, Weighting::noise_variance);
  EXPECT_TRUE(setup.structure.common.rigid_body);
  EXPECT_FALSE(setup.structure.common.general_damping);
  EXPECT_EQ(setup.selection.exactly, 0);
  EXPECT_TRUE(setup.selection.modes.empty());
}

TEST(FitRequest, AContinuousResponseHasNoHoldAndNoDelay) {
  FrfEstimate frf = without_variances();
  frf.hold = Hold::none;
  frf.sample_rate_hz = 0.0;
  const FitSetup setup = make_fit_setup({}, frf);
  EXPECT_EQ(setup.options.hold, HoldModel::none);
  EXPECT_EQ(setup.options.delay, DelayModel::fixed);
  EXPECT_EQ(setup.options.delay_s, 0.0);
  EXPECT_EQ(setup.options.weighting, Weighting::relative);
}

TEST(FitRequest, WithoutNoiseTheTotalVarianceWeighs) {
  FrfEstimate frf = without_variances();
  frf.total_variance = Eigen::MatrixXd::Constant(2, 4, 0.5);
  EXPECT_EQ(make_fit_setup({}, frf).options.weighting, Weighting::total_variance);
}

/// Thirty lines at distance `scatter` from a constant, in varying directions; their stated variance is 0.25.
FrfEstimate scattered(double scatter) {
  FrfEstimate frf = measured();
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(30, 10.0, 39.0);
  frf.noise_variance = Eigen::MatrixXd::Constant(2, 30, 0.25);
  frf.response = Eigen::MatrixXcd::NullaryExpr(2, 30, [scatter](Eigen::Index, Eigen::Index line) {
    return 10.0 + std::polar(scatter, 2.4 * static_cast<double>(line * line));
  });
  frf.realizations = 1;
  return frf;
}

TEST(FitRequest, OneRealizationOfADistortedPlantIsWeighedByTheScatterOfItsLines) {
  const FitSetup setup = make_fit_setup({}, scattered(2.0));
  EXPECT_EQ(setup.options.weighting, Weighting::total_variance);
  EXPECT_EQ(setup.frf.total_variance.cols(), 30);
  EXPECT_GT(setup.frf.total_dof, 0.0);
  EXPECT_THAT(setup.notes, testing::Contains(HasSubstr("scatter of neighbouring lines")));
  EXPECT_THAT(setup.warnings, testing::ElementsAre(HasSubstr("scatter of neighbouring lines")));
  FitRequest asked;
  asked.weighting = Weighting::noise_variance;
  EXPECT_EQ(make_fit_setup(asked, scattered(2.0)).options.weighting, Weighting::noise_variance);
}

TEST(FitRequest, LinesThatScatterAsTheNoiseSaysOrSeveralRealizationsAreWeighedByTheNoise) {
  EXPECT_EQ(make_fit_setup({}, scattered(0.5)).options.weighting, Weighting::noise_variance);
  FrfEstimate several = scattered(2.0);
  several.realizations = 2;
  EXPECT_EQ(make_fit_setup({}, several).options.weighting, Weighting::noise_variance);
}

TEST(FitRequest, AccelerationsGetTheStructureThatTheyHave) {
  FrfEstimate frf = measured();
  for (const char* unit : {"m/s^2", "mm/s2", "rad/s²", "g"}) {
    frf.outputs.units = {unit};
    const FitSetup setup = make_fit_setup({}, frf);
    EXPECT_TRUE(setup.structure.common.general_damping) << unit;
    EXPECT_TRUE(setup.structure.common.direct_term);
    EXPECT_FALSE(setup.structure.common.rigid_body);
    EXPECT_THAT(setup.notes.front(), HasSubstr("accelerations"));
  }
  FitRequest asked;  // an explicit request for one of the three is not changed
  asked.general_damping = false;
  const ModelStructure own = make_fit_setup(asked, frf).structure.common;
  EXPECT_FALSE(own.general_damping);
  EXPECT_FALSE(own.direct_term);
  EXPECT_TRUE(own.rigid_body);
  frf.outputs.units = {"kg"};
  EXPECT_FALSE(make_fit_setup({}, frf).structure.common.general_damping);
}

TEST(FitRequest, RefusesADelayThatTheLinesCannotTellFromItsAlias) {
  FitRequest request;
  for (const double delay_s : {0.05, -0.05}) {  // 1/(2 df) of lines 10 Hz apart
    request.delay = {DelayModel::fixed, delay_s};
    EXPECT_EQ(error_of(request), "no error") << delay_s;
  }
  for (const double delay_s : {0.051, -0.051, 1e9}) {
    request.delay = {DelayModel::fixed, delay_s};
    EXPECT_THAT(error_of(request), testing::AllOf(HasSubstr("delay"), HasSubstr("at most 0.05 s"),
                                                  HasSubstr("10 Hz apart")));
  }
}

TEST(FitRequest, WhatWasTakenOutIsPutBackAndModelledUnlessNoHoldIsAsked) {
  const FrfEstimate raw = measured();
  for (const Compensation compensation : {Compensation::delay, Compensation::hold}) {
    const FrfEstimate compensated = compensate(raw, compensation, 1.3e-3);
    const FitSetup setup = make_fit_setup({}, compensated);
    // Two rotations on the unit circle that undo each other.
    EXPECT_LT((setup.frf.response - raw.response).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_EQ(setup.frf.compensated, Compensation::none);
    EXPECT_EQ(setup.options.hold, HoldModel::exact);
    EXPECT_EQ(setup.options.delay, DelayModel::fixed);
    EXPECT_EQ(setup.options.delay_s, 1.3e-3);
    FitRequest request;
    request.hold = HoldModel::none;
    const FitSetup without = make_fit_setup(request, compensated);
    EXPECT_EQ(without.frf.response, compensated.response);
    EXPECT_EQ(without.options.delay_s, 0.0);
    EXPECT_EQ(without.options.delay, DelayModel::fixed);
  }
}

TEST(FitRequest, ModesThatTheLinesCannotTellAreRefused) {
  // As the automatic fit counts: two functions for four lines, one of them the rigid body's. One mode
  // is always granted.
  FitRequest request;
  request.modes = {ModesRequest::Kind::count, 2, {}};
  EXPECT_EQ(error_of(request),
            "modes: 2 is too many; 4 lines support at most 1; use fewer or a wider band");
  request.modes = {ModesRequest::Kind::given, 0, {{499.9}}};
  EXPECT_EQ(error_of(request), "no error");
  request.modes = {ModesRequest::Kind::given, 0, {{12.0}, {500.0}}};
  EXPECT_EQ(error_of(request),
            "modes: 500 Hz is not below half the sample rate, 500 Hz; use lower frequencies");
  FrfEstimate continuous = measured();
  continuous.hold = Hold::none;
  EXPECT_EQ(error_of(request, continuous), "no error");
}

TEST(FitRequest, WeightsComeFromAFileInTheOrderOfTheResponse) {
  const test::TemporaryDirectory directory;
  const std::filesystem::path path = directory / "w.h5";
  std::vector<double> values = {0, 1, 2, 3, 4, 5, 6, 7};
  const auto write = [&] {
    Hdf5File file = Hdf5File::create(path);
    file.write_reals("/weights", {4, 1, 2}, values.data());
    file.close();
  };
  write();
  FitRequest request;
  request.weighting = Weighting::user;
  request.weight_file = path;
  const FitSetup setup = make_fit_setup(request, measured());
  EXPECT_EQ(setup.options.weighting, Weighting::user);
  EXPECT_EQ((*setup.options.user_weights)(1, 0), 1.0);  // channel y <- b on the first line
  EXPECT_EQ((*setup.options.user_weights)(0, 3), 6.0);
  request.band_hz = {15.0, 35.0};  // of the whole response: those of the band are taken
  const FitSetup band = make_fit_setup(request, measured());
  ASSERT_EQ((*band.options.user_weights).cols(), 2);
  EXPECT_EQ((*band.options.user_weights)(0, 0), 2.0);
  EXPECT_EQ((*band.options.user_weights)(1, 1), 5.0);
  EXPECT_THROW(make_fit_setup(request, select_band(measured(), 15.0, 45.0)), FormatError);
  values[3] = -1.0;
  write();
  request.band_hz.reset();
  EXPECT_THROW(make_fit_setup(request, measured()), IndefiniteWeights);
}

TEST(FitRequest, RanksArePassedOn) {
  FitRequest request;
  EXPECT_EQ(make_fit_setup(request, measured()).options.residue_rank, 0);
  request.rigid_body = {RigidBodyRequest::Kind::free, 3};
  request.residue_rank = 1;
  const FitSetup setup = make_fit_setup(request, measured());
  EXPECT_TRUE(setup.structure.common.rigid_body);
  EXPECT_EQ(setup.options.rigid_body_rank, 3);
  EXPECT_EQ(setup.options.residue_rank, 1);
  EXPECT_NE(setup.request_json.find("\"residue_rank\":\"1\""), std::string::npos);
}

TEST(FitRequest, SubmodelsStandAloneUnlessMoreIsAsked) {
  FitRequest request;
  request.submodels = {parse_submodel("n=1,m=0,f=15")};
  FitSetup setup = make_fit_setup(request, measured());
  EXPECT_FALSE(setup.structure.common.rigid_body);
  EXPECT_TRUE(setup.selection.keep_modes);
  EXPECT_TRUE(setup.selection.modes.empty());
  EXPECT_EQ(setup.structure.submodels.size(), 1U);
  EXPECT_THAT(setup.request_json, HasSubstr("\"submodels\":[\"l=0,n=1,m=0,f=15\"]"));
  EXPECT_THAT(setup.request_json, HasSubstr("\"modes\":\"none\","));
  request.modes.kind = ModesRequest::Kind::search;
  request.rigid_body.kind = RigidBodyRequest::Kind::free;
  setup = make_fit_setup(request, measured());
  EXPECT_TRUE(setup.structure.common.rigid_body);
  EXPECT_FALSE(setup.selection.keep_modes);
}

TEST(FitRequest, ASuspensionStandsInsteadOfTheRigidBody) {
  FitRequest request;
  request.rigid_body.kind = RigidBodyRequest::Kind::suspension;
  FitSetup setup = make_fit_setup(request, measured());
  EXPECT_FALSE(setup.structure.common.rigid_body);
  EXPECT_TRUE(setup.structure.suspension);
  EXPECT_TRUE(setup.structure.suspension_hz.empty());
  request.rigid_body.suspension_hz = {0.4, 0.5};
  setup = make_fit_setup(request, measured());
  EXPECT_EQ(setup.structure.suspension_hz, (std::vector<double>{0.4, 0.5}));
  EXPECT_THAT(setup.request_json, HasSubstr("\"rigid_body\":\"suspension:0.4:0.5\""));
}

TEST(FitRequest, ContradictingStructuresAreRefusedByName) {
  FitRequest request;
  request.rigid_body = {RigidBodyRequest::Kind::suspension, 0, {10.0}};
  EXPECT_THAT(error_of(request), HasSubstr("below the lowest line, 10 Hz"));
  request = {};
  request.rigid_body.kind = RigidBodyRequest::Kind::none;
  request.modes.kind = ModesRequest::Kind::none;
  EXPECT_THAT(error_of(request), HasSubstr("modes: got none"));
  request = {};
  request.submodels = {parse_submodel("l=1,n=0")};
  EXPECT_EQ(error_of(request), "no error");
  request.rigid_body.kind = RigidBodyRequest::Kind::free;
  EXPECT_THAT(error_of(request), HasSubstr("submodel: 2 terms with integrators"));
  request = {};
  request.submodels = {parse_submodel("n=2,m=2")};
  request.direct_term = true;
  EXPECT_THAT(error_of(request), HasSubstr("submodel: 2 biproper"));
  request = {};
  request.submodels = {parse_submodel("n=2,f=600")};
  EXPECT_THAT(error_of(request), HasSubstr("submodel: 600 Hz is not below"));
  request.submodels = {parse_submodel("n=4,m=3")};
  request.residue_rank = 1;
  EXPECT_THAT(error_of(request), HasSubstr("not to submodel l=0,n=4,m=3"));
  request.submodels = {parse_submodel("n=2,m=1"), parse_submodel("n=0")};
  EXPECT_EQ(error_of(request), "no error");
}

TEST(FitRequest, TheRequestIsNamedWhole) {
  FitRequest request;
  request.threads = 1;
  const std::string one = make_fit_setup(request, measured()).request_json;
  request.threads = 2;
  EXPECT_EQ(make_fit_setup(request, measured()).request_json, one);
  request.method = FitMethod::gn;
  EXPECT_NE(make_fit_setup(request, measured()).request_json, one);
  EXPECT_THAT(one, HasSubstr("\"hold\":\"exact\""));
}

}  // namespace stageid::test_fit_request
