// The general additive structure through the program: flags, configuration keys, files, exit codes.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "estimation/model/additive_model.hpp"
#include "tests/tools/program_fixture.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid::test {
namespace test_general_structure {

using testing::HasSubstr;

class GeneralStructure : public ProgramTest {};

TEST_F(GeneralStructure, OneDenominatorForTwoModesBesideTheOthers) {
  make_frf();
  const std::string fit =
      "fit frf.h5 -o m.json --band 120 800 --submodel n=4 --modes 488,567 --rigid-body full "
      "--direct-term full";
  const ProgramResult result = succeed(fit);
  EXPECT_THAT(result.out, HasSubstr("submodel of order 4: poles start at the modes 181"));
  const std::string bytes = read_bytes(at("m.json"));
  const AdditiveModel model = read_model(at("m.json"));
  ASSERT_EQ(model.submodels.size(), 5U);
  const Submodel& fourth = model.submodels[2];
  ASSERT_EQ(fourth.poles.size(), 2U);
  EXPECT_NEAR(fourth.poles[0].natural_frequency_hz, 181.147, 0.01);
  EXPECT_NEAR(fourth.poles[1].natural_frequency_hz, 422.22, 0.05);
  EXPECT_GT(fourth.poles[0].natural_frequency_std_hz.value(), 0.0);
  succeed(fit + " --threads 2");
  EXPECT_TRUE(same_bytes(read_bytes(at("m.json")), bytes));
}

TEST_F(GeneralStructure, WhatTheDataDoNotDetermineEndsWithThree) {
  make_frf();
  ends("fit frf.h5 -o m.json --band 120 800 --submodel n=2,m=1,f=181 --submodel n=2,m=1,f=181", 3,
       "submodel ");
  EXPECT_THAT(read_bytes(at("m.json")), testing::Not(HasSubstr("null")));
}

TEST_F(GeneralStructure, ASuspensionIsFittedFromTheLowestLine) {
  make_frf();
  succeed("fit frf.h5 -o m.json --rigid-body suspension:0.4:0.5 --direct-term full");
  const AdditiveModel model = read_model(at("m.json"));
  EXPECT_NEAR(model.fit.band_hz[0], 16.0, 1e-9);
  // Two of the suspension, four flexible ones, a direct term; no substitute modes.
  ASSERT_EQ(model.submodels.size(), 7U);
  for (const Submodel& s : model.submodels) {
    if (!s.is_mode()) continue;
    EXPECT_TRUE(s.natural_frequency_hz() < 1.0 || s.natural_frequency_hz() > 180.0);
  }
}

TEST_F(GeneralStructure, KeysSayWhatFlagsSay) {
  const ExperimentConfig config = load_experiment_config(
      experiment("keys.yaml", "direct_term: full",
                 "submodels: [{l: 1, n: 4, m: 3, frequency_hz: [120, 180], damping_ratio: [0.01]}, "
                 "{n: 1}, {n: 0}]\n  modes: auto"));
  ASSERT_EQ(config.fit.submodels.size(), 3U);
  EXPECT_EQ(config.fit.submodels[0].shape.integrators, 1);
  EXPECT_EQ(config.fit.submodels[0].shape.order, 4);
  EXPECT_EQ(config.fit.submodels[0].shape.numerator_degree, 3);
  EXPECT_EQ(config.fit.submodels[0].frequency_hz, (std::vector<double>{120.0, 180.0}));
  EXPECT_EQ(config.fit.submodels[0].damping_ratio, (std::vector<double>{0.01}));
  EXPECT_EQ(config.fit.submodels[1].shape.numerator_degree, 0);
  EXPECT_EQ(config.fit.modes.kind, ModesRequest::Kind::search);
  EXPECT_EQ(config.fit.rigid_body.kind, RigidBodyRequest::Kind::suspension);
  EXPECT_EQ(config.fit.rigid_body.suspension_hz, (std::vector<double>{0.4, 0.5}));
}

}  // namespace test_general_structure
}  // namespace stageid::test
