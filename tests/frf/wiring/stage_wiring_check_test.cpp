#include "frf/wiring/stage_wiring_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_stage_wiring_check {

using Index = Eigen::Index;

constexpr Index kChannels = 3;
const std::vector<Index> kAll = {0, 1, 2};
constexpr Index kLines = 10;

/// Lines of a free body from 6 to 33 Hz. Each entry of each line deviates by `distortion` times the rms of its row,
/// of which the periods show nothing; sensor 1 is recorded too large by `factor`.
std::vector<PlantLine> body(std::uint64_t seed, double distortion, double factor) {
  test::RandomNumbers random(seed);
  Eigen::MatrixXd mobility(kChannels, kChannels);
  for (double& entry : mobility.reshaped()) entry = random.uniform(-1.0, 1.0);
  mobility.diagonal().array() += 2.0;
  std::vector<PlantLine> lines;
  for (Index k = 0; k < kLines; ++k) {
    PlantLine line;
    line.omega_rad_s = 2.0 * std::numbers::pi * (6.0 + 3.0 * static_cast<double>(k));
    const double gain = -1.0 / (line.omega_rad_s * line.omega_rad_s);
    line.G0 = (gain * mobility).cast<std::complex<double>>();
    line.G = line.G0;
    for (Index i = 0; i < kChannels; ++i) {
      const double rms = line.G0.row(i).norm() / std::sqrt(static_cast<double>(kChannels));
      for (std::complex<double>& entry : line.G.row(i))
        entry += distortion * rms * std::complex<double>(random.normal(), random.normal());
    }
    line.G.row(1) *= factor;
    line.variance = Eigen::MatrixXd::Constant(kChannels, kChannels, 1e-12 * gain * gain);
    lines.push_back(std::move(line));
  }
  return lines;
}

std::vector<ChannelError> errors(std::uint64_t seed, double distortion, double factor) {
  return check_stage_wiring(body(seed, distortion, factor), kAll, kAll).errors;
}

// A nonlinear plant distorts the lines, the same in all periods.
TEST(StageWiring, DistortionIsNoFactorOfAChannel) {
  int told = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed)
    if (!errors(seed, 0.5, 1.0).empty()) ++told;
  EXPECT_LE(told, 2);
}

TEST(StageWiring, AFactorIsFoundInSpiteOfDistortion) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const std::vector<ChannelError> found = errors(seed, 0.05, 2.0);
    ASSERT_EQ(found.size(), 1U) << seed;
    EXPECT_EQ(found[0].kind, ChannelError::Kind::gain);
    EXPECT_TRUE(found[0].of_sensors);
    EXPECT_EQ(found[0].a, 1);
    EXPECT_NEAR(found[0].value, 2.0, 0.3);
  }
}

// Above a mode, the plant is larger than its rigid body and its omega^2 |G| falls. No channel has a factor.
TEST(StageWiring, LinesAboveAModeAreNoRigidBody) {
  std::vector<PlantLine> lines = body(1, 0.0, 1.0);
  const double first = lines.front().omega_rad_s;
  for (PlantLine& line : lines) line.G *= 1.0 + 30.0 * std::pow(first / line.omega_rad_s, 2);
  const StageWiringCheck check = check_stage_wiring(lines, kAll, kAll);
  EXPECT_TRUE(check.errors.empty());
  EXPECT_FALSE(check.unchecked.empty());
}

// A spring below the heave, as stiff as a cubic one becomes: it resonates just below the lines, at 4 to 5.5 Hz, and
// moves all sensors alike.
TEST(StageWiring, ASuspensionThatTheMotionStiffensIsNotAFactor) {
  int told = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    test::RandomNumbers random(seed);
    std::vector<PlantLine> lines = body(seed, 0.0, 1.0);
    const Eigen::Vector3d sensors(1.0, random.uniform(0.8, 1.2), random.uniform(0.8, 1.2));
    const double resonance_rad_s = 2.0 * std::numbers::pi * random.uniform(4.0, 5.5);
    for (PlantLine& line : lines) {
      const double omega2 = line.omega_rad_s * line.omega_rad_s;
      const Eigen::MatrixXd heave = -3.0 / omega2 * sensors * Eigen::RowVector3d::Ones();
      line.G0 += heave;
      line.G += omega2 / (omega2 - resonance_rad_s * resonance_rad_s) * heave;
    }
    if (!check_stage_wiring(lines, kAll, kAll).errors.empty()) ++told;
  }
  EXPECT_EQ(told, 0);
}

}  // namespace stageid::test_stage_wiring_check
