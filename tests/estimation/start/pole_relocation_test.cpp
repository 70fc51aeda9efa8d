// Pole relocation finds modes from nothing, behind every hold.

#include "estimation/start/pole_relocation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test_pole_relocation {

using test::DenseProblem;

std::vector<ModeCandidate> relocate(const DenseProblem& problem, std::size_t modes,
                                    int threads = 1) {
  AdditiveModel beside = problem.model;
  beside.hold = problem.hold;
  beside.submodels.resize(1);  // the rigid body
  FrfEstimate frf = test::frf_of(problem);
  return relocate_poles(frf, beside, problem.W, modes, threads);
}

class PoleRelocation : public testing::TestWithParam<HoldModel> {};

TEST_P(PoleRelocation, FindsTheModesOfExactData) {
  const DenseProblem problem = test::noisy_stage(GetParam(), 0.0);
  const std::vector<ModeCandidate> modes = relocate(problem, 3);
  ASSERT_EQ(modes.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    const Submodel& truth = problem.model.submodels[i + 1];
    // Normal equations keep half the digits, the condition of two modes 1.5 % apart takes some more.
    EXPECT_NEAR(modes[i].frequency_hz, truth.natural_frequency_hz(),
                1e-5 * truth.natural_frequency_hz());
    EXPECT_NEAR(modes[i].damping_ratio, truth.damping_ratio(), 1e-3 * truth.damping_ratio());
  }
}

TEST_P(PoleRelocation, TooManyPolesAreStableAndHoldTheTrueOnes) {
  const DenseProblem problem = test::noisy_stage(GetParam(), 1e-3);
  const std::vector<ModeCandidate> modes = relocate(problem, 8);
  ASSERT_LE(modes.size(), 8U);
  for (const ModeCandidate& mode : modes) {
    EXPECT_GT(mode.damping_ratio, 0.0);
    EXPECT_GT(mode.frequency_hz, 0.0);
  }
  for (std::size_t i = 1; i < 4; ++i) {
    const double f = problem.model.submodels[i].natural_frequency_hz();
    EXPECT_TRUE(std::ranges::any_of(modes, [&](const ModeCandidate& mode) {
      return std::abs(mode.frequency_hz - f) < 0.005 * f;
    })) << f;
  }
}

INSTANTIATE_TEST_SUITE_P(Holds, PoleRelocation,
                         testing::Values(HoldModel::none, HoldModel::phase, HoldModel::sinc,
                                         HoldModel::exact),
                         [](const auto& instance) {
                           return std::string(to_string(instance.param));
                         });

TEST(PoleRelocationShares, DoNotDependOnTheThreads) {
  const DenseProblem problem = test::noisy_stage(HoldModel::none, 1e-3);
  const std::vector<ModeCandidate> one = relocate(problem, 5, 1);
  const std::vector<ModeCandidate> two = relocate(problem, 5, 2);
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].frequency_hz, two[i].frequency_hz);
}

// The conjugate of a stable plant's response is that of one with its poles on the other side.
TEST(PoleRelocationShares, DataOfAnUnstablePlantGiveStableModesAndNoRequestNone) {
  DenseProblem problem = test::noisy_stage(HoldModel::none, 1e-4);
  problem.G = problem.G.conjugate().eval();
  const std::vector<ModeCandidate> modes = relocate(problem, 3);
  ASSERT_FALSE(modes.empty());
  for (const ModeCandidate& mode : modes) EXPECT_GT(mode.damping_ratio, 0.0);
  EXPECT_TRUE(relocate(test::noisy_stage(HoldModel::none, 0.0), 0).empty());
}

/// A mode at 900 Hz whose width is a tenth of the line spacing: one line determines its frequency, none its damping.
DenseProblem with_narrow_mode(double noise) {
  DenseProblem problem = test::noisy_stage(HoldModel::none, noise);
  const Eigen::MatrixXcd added =
      problem.G - test::reference_response(problem.model, problem.frequency_hz, problem.hold);
  const std::vector<double> a = test::mode_coefficients(900.0, 2.5e-4);
  problem.model.submodels[2].denominator = {1.0, a[0], a[1]};
  problem.model.submodels.resize(3);
  problem.G = test::reference_response(problem.model, problem.frequency_hz, problem.hold) + added;
  problem.W = problem.G.cwiseAbs2().cwiseInverse();
  return problem;
}

TEST(PoleRelocationShares, AModeNarrowerThanTheLinesIsPlacedWider) {
  const DenseProblem problem = with_narrow_mode(1e-2);
  const std::vector<ModeCandidate> modes = relocate(problem, 2);
  ASSERT_EQ(modes.size(), 2U);
  const double spacing_hz = problem.frequency_hz[1] - problem.frequency_hz[0];
  EXPECT_NEAR(modes[1].frequency_hz, 900.0, spacing_hz);
  EXPECT_NEAR(2.0 * modes[1].damping_ratio * modes[1].frequency_hz, 3.0 * spacing_hz,
              1e-6 * spacing_hz);
}

TEST(PoleRelocationShares, WithoutNoiseAModeNarrowerThanTheLinesIsFoundExactly) {
  const std::vector<ModeCandidate> modes = relocate(with_narrow_mode(0.0), 2);
  ASSERT_EQ(modes.size(), 2U);
  EXPECT_NEAR(modes[1].frequency_hz, 900.0, 1e-9 * 900.0);
  EXPECT_NEAR(modes[1].damping_ratio, 2.5e-4, 1e-6 * 2.5e-4);
}

}  // namespace stageid::test_pole_relocation
