#include "frf/wiring/skew_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "frf/runs/channel_choice.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_skew_check {

using Index = Eigen::Index;

struct PlantRequest {
  std::uint64_t seed = 1;
  Index sensors = 4;
  Index actuators = 8;
  double shape_phase_rad = 0.0;  ///< rms over the entries of the mode shapes
  double noise = 1e-3;           ///< of every entry
  Eigen::VectorXd late_s = {};   ///< [sensors; actuators]; empty: no channel
};

/// A rigid body and 15 modes of random shapes, 170 to 2300 Hz, damping ratio 0.003 to 0.015, by the sum of their
/// fractions. A shape with phases has the residue Re R + Im R s / omega_r, as for viscous damping that is not
/// proportional.
std::vector<PlantLine> random_plant(const PlantRequest& request) {
  test::RandomNumbers random(request.seed);
  const std::complex<double> j(0.0, 1.0);
  const auto shape = [&](Index n) {
    Eigen::VectorXcd phi(n);
    for (auto& value : phi)
      value = 0.25 * random.normal() * std::polar(1.0, request.shape_phase_rad * random.normal());
    return phi;
  };
  struct Mode {
    double omega = 0.0;
    double damping = 0.0;
    Eigen::MatrixXcd R;
  };
  std::vector<Mode> modes(15);
  for (Mode& mode : modes) {
    mode.omega = 2.0 * std::numbers::pi * random.uniform(170.0, 2300.0);
    mode.damping = random.uniform(0.003, 0.015);
    const Eigen::VectorXcd sensor_side = shape(request.sensors);
    mode.R = sensor_side * shape(request.actuators).transpose();
  }
  const auto arms = [&](Index n) {
    Eigen::MatrixXd at = Eigen::MatrixXd::Ones(n, 3);
    for (Index i = 0; i < n; ++i)
      for (Index axis = 1; axis < 3; ++axis) at(i, axis) = random.uniform(-0.3, 0.3);
    return at;
  };
  const Eigen::MatrixXd sensor_arms = arms(request.sensors);
  const Eigen::MatrixXd rigid = sensor_arms *
                                Eigen::Vector3d(1.0 / 20.0, 1.0 / 0.6, 1.0 / 0.6).asDiagonal() *
                                arms(request.actuators).transpose();
  std::vector<PlantLine> lines;
  for (double frequency_hz = 5.0; frequency_hz < 2000.0; frequency_hz += 5.0) {
    PlantLine line;
    const double omega = line.omega_rad_s = 2.0 * std::numbers::pi * frequency_hz;
    line.G = -rigid / (omega * omega);
    for (const Mode& mode : modes)
      line.G +=
          (mode.R.real() + mode.R.imag() * (j * omega / mode.omega)) /
          (mode.omega * mode.omega - omega * omega + 2.0 * j * mode.damping * mode.omega * omega);
    line.variance = (request.noise * line.G.cwiseAbs()).cwiseAbs2();
    for (auto& value : line.G.reshaped())
      value += request.noise * std::abs(value) * random.circular();
    for (Index c = 0; c < request.late_s.size(); ++c) {
      const std::complex<double> turn = std::polar(1.0, -omega * request.late_s[c]);
      if (c < request.sensors)
        line.G.row(c) *= turn;
      else
        line.G.col(c - request.sensors) *= turn;
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

SkewCheck checked(const PlantRequest& request) {
  return check_skew(random_plant(request), first_indices(request.sensors),
                    first_indices(request.actuators));
}

TEST(SkewCheck, TellsTheLateChannelToAMicrosecond) {
  for (const double late_s : {10e-6, -100e-6})
    for (const Index c : {0, 3, 4, 11}) {
      PlantRequest request;
      request.seed = static_cast<std::uint64_t>(c) + 1;
      request.late_s = late_s * Eigen::VectorXd::Unit(12, c);
      const SkewCheck check = checked(request);
      ASSERT_EQ(check.errors.size(), 1U) << "channel " << c << ", " << late_s;
      EXPECT_EQ(check.errors[0].of_sensors, c < 4);
      EXPECT_EQ(check.errors[0].a, c < 4 ? c : c - 4);
      EXPECT_NEAR(check.errors[0].value, late_s, 1e-6);
    }
}

TEST(SkewCheck, TellsSeveralAtOnce) {
  PlantRequest request;
  request.late_s = Eigen::VectorXd::Zero(12);
  request.late_s[1] = 20e-6;
  request.late_s[6] = -10e-6;
  request.late_s[9] = 15e-6;
  const SkewCheck check = checked(request);
  ASSERT_EQ(check.errors.size(), 3U);
  EXPECT_NEAR(check.errors[0].value, 20e-6, 1e-6);
  EXPECT_NEAR(check.errors[1].value, -10e-6, 1e-6);
  EXPECT_NEAR(check.errors[2].value, 15e-6, 1e-6);
}

TEST(SkewCheck, ThreeByThreeIsEnough) {
  PlantRequest request;
  request.sensors = request.actuators = 3;
  request.late_s = 10e-6 * Eigen::VectorXd::Unit(6, 4);
  const SkewCheck check = checked(request);
  ASSERT_EQ(check.errors.size(), 1U) << check.unchecked;
  EXPECT_EQ(check.errors[0].a, 1);
  EXPECT_NEAR(check.errors[0].value, 10e-6, 1e-6);
}

// A phase of 1 degree at 500 Hz corresponds to 5.6 us.
TEST(SkewCheck, FindsNothingWhereNobodyIsLateEvenIfModeShapesAreNotQuiteReal) {
  PlantRequest request;
  for (request.seed = 1; request.seed <= 10; ++request.seed)
    for (const double phase_deg : {0.0, 1.0}) {
      request.shape_phase_rad = phase_deg * std::numbers::pi / 180.0;
      const SkewCheck check = checked(request);
      EXPECT_TRUE(check.unchecked.empty()) << check.unchecked;
      EXPECT_TRUE(check.errors.empty()) << request.seed << ", " << phase_deg;
    }
}

TEST(SkewCheck, TooMuchNoiseIsNotCheckedRatherThanFine) {
  PlantRequest request;
  request.noise = 1.0;
  const SkewCheck check = checked(request);
  EXPECT_TRUE(check.errors.empty());
  EXPECT_NE(check.unchecked.find("above the noise"), std::string::npos) << check.unchecked;
}

}  // namespace stageid::test_skew_check
