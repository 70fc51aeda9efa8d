#include "estimation/model/submodel_request.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "estimation/model/poles.hpp"
#include "estimation/search/structured_fit.hpp"
#include "tests/estimation/submodel_cases.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_submodel_request {

using testing::HasSubstr;
using testing::IsEmpty;

SubmodelRequest request(SubmodelShape shape, std::vector<double> frequency_hz = {},
                        std::vector<double> damping_ratio = {}) {
  return {shape, false, std::move(frequency_hz), std::move(damping_ratio)};
}

TEST(SubmodelRequest, WhatTheStructureAllowsHasNoFault) {
  EXPECT_THAT(fault_of(request({0, 2, 0})), IsEmpty());
  EXPECT_THAT(fault_of(request({1, 3, 4}, {120.0, 30.0}, {0.02})), IsEmpty());
  EXPECT_THAT(fault_of(request({0, 4, 3}, {120.0, 180.0}, {0.02, 0.01})), IsEmpty());
  EXPECT_THAT(fault_of({{}, true, {}, {}}), IsEmpty());
}

TEST(SubmodelRequest, EveryFaultSaysWhatWouldBeRight) {
  const auto fault = [](const SubmodelRequest& r) { return fault_of(r); };
  EXPECT_THAT(fault(request({3, 2, 0})), HasSubstr("0, 1 or 2 integrators"));
  EXPECT_THAT(fault(request({-1, 2, 0})), HasSubstr("0, 1 or 2 integrators"));
  EXPECT_THAT(fault(request({0, 17, 0})), HasSubstr("from 0 to 16"));
  EXPECT_THAT(fault(request({0, -1, 0})), HasSubstr("from 0 to 16"));
  EXPECT_THAT(fault(request({0, 2, -1})), HasSubstr("0 or more"));
  EXPECT_THAT(fault(request({1, 2, 4})), HasSubstr("give at most 3"));
  EXPECT_THAT(fault(request({0, 4, 3}, {120.0})), HasSubstr("needs 2 frequencies"));
  EXPECT_THAT(fault(request({0, 3, 0}, {120.0})), HasSubstr("the last for the real pole"));
  EXPECT_THAT(fault(request({0, 2, 0}, {0.0})), HasSubstr("above 0 Hz"));
  EXPECT_THAT(fault(request({0, 2, 0}, {}, {0.01})), HasSubstr("needs a frequency"));
  EXPECT_THAT(fault(request({0, 6, 0}, {1.0, 2.0, 3.0}, {0.01, 0.02})), HasSubstr("one damping"));
  EXPECT_THAT(fault(request({0, 1, 0}, {30.0}, {0.01})), HasSubstr("no damping ratio"));
  EXPECT_THAT(fault(request({0, 2, 0}, {30.0}, {1.0})), HasSubstr("at most 0.9"));
  EXPECT_THAT(fault(request({0, 4, 0}, {30.0, 30.0})), HasSubstr("indistinguishable"));
  EXPECT_THAT(fault({{}, true, {30.0}, {}}), HasSubstr("omit frequencies"));
  EXPECT_THAT(fault({{1, 0, 0}, true, {}, {}}), HasSubstr("omit l"));
}

TEST(SubmodelRequest, TogetherAtMostOneIntegratesAndOneIsBiproper) {
  const SubmodelRequest integrator = request({1, 0, 0});
  const SubmodelRequest constant = request({0, 0, 0});
  const SubmodelRequest mode = request({0, 2, 1});
  EXPECT_THAT(fault_of({integrator, constant, mode, mode}, false, false), IsEmpty());
  EXPECT_THAT(fault_of({integrator, mode}, true, false), HasSubstr("including the rigid body"));
  EXPECT_THAT(fault_of({integrator, request({2, 0, 0})}, false, false), HasSubstr("2 terms"));
  EXPECT_THAT(fault_of({constant}, false, true), HasSubstr("including the direct term"));
  EXPECT_THAT(fault_of({constant, request({0, 2, 2})}, false, false), HasSubstr("2 biproper"));
  EXPECT_THAT(fault_of({{{}, true, {}, {}}, mode}, false, false), HasSubstr("only submodel"));
}

TEST(SubmodelRequest, TheStartMultipliesItsPoles) {
  const FrfEstimate frf = test::frf_of(test::measured({{2, {}, 0}}, HoldModel::none, 0.0));
  const Submodel s = start_submodel(frf, request({1, 5, 2}, {120.0, 180.0, 30.0}, {0.02, 0.03}));
  test::Poles poles = test::joined(mode_poles(120.0, 0.02), mode_poles(180.0, 0.03));
  poles.push_back(test::real_pole(30.0));
  const Eigen::VectorXd a = denominator_of(poles);
  EXPECT_EQ(s.integrators, 1);
  EXPECT_EQ(s.numerator.size(), 3U);
  ASSERT_EQ(s.denominator.size(), 6U);
  for (std::size_t q = 1; q < 6; ++q)
    EXPECT_NEAR(s.denominator[q], a[static_cast<Eigen::Index>(q) - 1], 1e-14 * s.denominator[q]);
  EXPECT_EQ(s.role, SubmodelRole::given);
}

TEST(SubmodelRequest, TheFitRefusesWhatHasAFault) {
  const FrfEstimate frf = test::frf_of(test::measured({{2, {}, 0}}, HoldModel::none, 0.0));
  const auto refused = [&](const RequestedStructure& structure, const char* part) {
    EXPECT_THAT(
        test::error_message<std::invalid_argument>([&] { structured_fit(frf, structure, {}, {}); }),
        HasSubstr(part));
  };
  RequestedStructure structure;
  structure.common.rigid_body = true;
  structure.submodels = {request({0, 2, 3})};
  refused(structure, "improper");
  structure.submodels = {request({1, 0, 0})};
  refused(structure, "including the rigid body");
  structure.submodels.clear();
  structure.suspension = true;
  refused(structure, "replaces the rigid body");
  structure.common.rigid_body = false;
  structure.suspension_hz = {7.0};
  refused(structure, "below the lowest line, 5 Hz");
}

}  // namespace stageid::test_submodel_request
