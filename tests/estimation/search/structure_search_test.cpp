#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "estimation/request/fit_request.hpp"
#include "estimation/search/fit_additive_model.hpp"
#include "tests/support/stages/varied_plant.hpp"

// Plants of random structure, fitted without any option and with one that is wrong.

namespace stageid {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// Fitted from the true structure and the true parameters.
double cost_of_truth(const test::VariedPlant& plant) {
  FitOptions options = make_fit_setup({}, plant.frf).options;
  options.delay = plant.delay;
  options.delay_s = plant.truth.mean_delay_s();
  options.uncertainty = false;
  return fit_additive_model(plant.frf, plant.truth, options).model.fit.cost;
}

class StructureSearch : public testing::TestWithParam<std::uint64_t> {};

TEST_P(StructureSearch, FindsTheStructureOfAPlant) {
  const test::VariedPlant plant = test::draw_varied_plant(GetParam());
  const FitResult fit = fit_model(plant.frf);
  EXPECT_TRUE(fit.trustworthy()) << plant.description() << ": " << fit.message;
  EXPECT_NEAR(fit.model.fit.cost / cost_of_truth(plant), 1.0, 0.01) << plant.description();
  EXPECT_EQ(fit.model.submodels.size(), plant.truth.submodels.size()) << plant.description();
  EXPECT_EQ(fit.delay, plant.delay);
}

// Of the first forty, those that are fitted within seconds. They cover a missing, a free and a suspended body, both
// dampings, direct terms, and delays per channel.
INSTANTIATE_TEST_SUITE_P(Plants, StructureSearch, testing::Values(3, 5, 10, 11, 12, 18, 33, 35));

TEST(StructureSearchFixed, WhatIsRequestedIsNotChanged) {
  const test::VariedPlant plant = test::draw_varied_plant(5);  // free body, general damping
  FitRequest request;
  request.search_seconds = 1.0;
  request.general_damping = false;
  request.direct_term = false;
  request.rigid_body.kind = RigidBodyRequest::Kind::free;
  request.delay = DelayRequest{DelayModel::estimate};
  const FitResult fit = fit_model(plant.frf, request);
  const ModelStructure found = structure_of(fit.model);
  EXPECT_FALSE(found.general_damping);
  EXPECT_FALSE(found.direct_term);
  EXPECT_TRUE(found.rigid_body);
  EXPECT_EQ(fit.delay, DelayModel::estimate);
  EXPECT_THAT(fit.decisions, Not(Contains(HasSubstr("structure: "))));
  EXPECT_FALSE(fit.trustworthy());
  EXPECT_THAT(fit.message, HasSubstr("--damping general"));
}

TEST(StructureSearchFixed, ANumberOfModesLeavesTheStructureOpen) {
  const test::VariedPlant plant = test::draw_varied_plant(5);
  FitRequest request;
  request.modes.kind = ModesRequest::Kind::count;
  request.modes.count = count_modes(plant.truth);
  const FitResult fit = fit_model(plant.frf, request);
  EXPECT_TRUE(fit.trustworthy()) << fit.message;
  EXPECT_TRUE(structure_of(fit.model).general_damping);
  EXPECT_NEAR(fit.model.fit.cost / cost_of_truth(plant), 1.0, 0.01);
}

}  // namespace
}  // namespace stageid
