#include <gtest/gtest.h>

#include <complex>
#include <numbers>
#include <stdexcept>

#include "excitation/decompositions/decompositions.hpp"
#include "hal/simulator/modal_plant.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "hal/simulator/simulated_stage.hpp"
#include "tests/hal/measured_response.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_plant_response {

using Complex = std::complex<double>;
constexpr double kTwoPi = 2.0 * std::numbers::pi;
constexpr double kRate_hz = 1e4;

std::vector<PlantMode> one_mode(double frequency_hz, double damping) {
  return {{frequency_hz, damping, Eigen::VectorXd::Ones(1), Eigen::VectorXd::Ones(1)}};
}

/// The exact frequency response without hold and sampler.
Eigen::MatrixXcd continuous_response(const std::vector<PlantMode>& modes, double frequency_hz) {
  const double omega = kTwoPi * frequency_hz;
  Eigen::MatrixXcd sum =
      Eigen::MatrixXcd::Zero(modes[0].sensor_shape.size(), modes[0].actuator_shape.size());
  for (const PlantMode& mode : modes) {
    const double omega_0 = kTwoPi * mode.natural_frequency_hz;
    const Complex position = 1.0 / Complex((omega_0 - omega) * (omega_0 + omega),
                                           2.0 * mode.damping_ratio * omega_0 * omega);
    const Eigen::MatrixXd shapes = mode.sensor_shape * mode.actuator_shape.transpose();
    sum += position * shapes;
  }
  return sum;
}

// Sampling folds: G_d(e^(j w T)) = sum_k G(s_k) e^(-s_k tau) (1 - e^(-s_k T)) / (s_k T),
// s_k = j (w + 2 pi k / T). Terms fall like 1/k^3: 2000 of them leave 1e-7 of the first ones' size.
Complex folded(const std::vector<PlantMode>& modes, double delay_s, double frequency_hz) {
  Complex sum = 0.0;
  for (int k = -2000; k <= 2000; ++k) {
    const double f = frequency_hz + k * kRate_hz;
    const Complex s(0.0, kTwoPi * f);
    const Complex hold = (1.0 - std::exp(-s / kRate_hz)) / (s / kRate_hz);
    sum += continuous_response(modes, f)(0, 0) * std::exp(-s * delay_s) * hold;
  }
  return sum;
}

TEST(SampledResponse, IsTheFoldedContinuousOne) {
  for (const auto& modes :
       {one_mode(300.0, 0.01), one_mode(2600.0, 0.005), one_mode(7000.0, 0.02)}) {
    for (const double delay_s : {0.0, 130e-6, 200e-6, 470e-6}) {
      for (const double f : {3.0, 290.0, 1999.75, 4900.0}) {
        const Complex exact = sampled_response(modes, delay_s, kRate_hz, f)(0, 0);
        EXPECT_LT(std::abs(exact - folded(modes, delay_s, f)), 1e-6 * std::abs(exact))
            << modes[0].natural_frequency_hz << " Hz, delay " << delay_s << ", at " << f;
      }
    }
  }
}

TEST(SampledResponse, OfAFreeMassIsTheLimitOfEverWeakerSprings) {
  for (const double delay_s : {0.0, 130e-6}) {
    for (const double f : {1.0, 100.0, 3000.0}) {
      const Complex free_mass = sampled_response(one_mode(0.0, 0.0), delay_s, kRate_hz, f)(0, 0);
      const Complex sprung = sampled_response(one_mode(1e-4, 0.0), delay_s, kRate_hz, f)(0, 0);
      // The spring changes it by (1e-4 / f)^2; partial fractions lose f / 1e-4 of their digits.
      EXPECT_LT(std::abs(free_mass - sprung), 2e-8 * std::abs(free_mass)) << f;
    }
  }
}

TEST(SampledResponse, AtZeroFrequencyIsTheStaticCompliance) {
  const double omega = kTwoPi * 300.0;
  const Complex compliance = sampled_response(one_mode(300.0, 0.01), 130e-6, kRate_hz, 0.0)(0, 0);
  EXPECT_NEAR(compliance.real() * omega * omega, 1.0, 1e-12);
  EXPECT_NEAR(compliance.imag() * omega * omega, 0.0, 1e-12);
}

TEST(SampledResponse, DelayedByWholeSamplesTurnsThePhaseOnly) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  const auto modes = plant_modes(spec.info, spec.plant);
  const double f = 777.0;
  const Eigen::MatrixXcd once = sampled_response(modes, 130e-6, kRate_hz, f);
  const Eigen::MatrixXcd later = sampled_response(modes, 430e-6, kRate_hz, f);
  const Complex turn = std::polar(1.0, -kTwoPi * f * 3.0 / kRate_hz);
  EXPECT_LT((later - turn * once).norm(), 1e-12 * once.norm());
}

// Between suspension and first flexible mode the stage is a rigid body: G = J_y M^-1 J_u^T / s^2.
TEST(ContinuousResponse, OfTheStageIsARigidBodyBelowTheFlexibleModes) {
  test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  const auto inertia = spec.plant.axis_inertia();
  Eigen::MatrixXd accelerations = rigid_body_jacobian(spec.info.actuators).transpose();
  for (int i = 0; i < 6; ++i) accelerations.row(i) /= inertia[i];
  const Eigen::MatrixXd mass_line = rigid_body_jacobian(spec.info.sensors) * accelerations;
  const double f = 10.0;
  const double omega = kTwoPi * f;
  const Eigen::MatrixXcd G = continuous_response(plant_modes(spec.info, spec.plant), f);
  // Springs: (0.5 / 10)^2 = 2.5e-3, damping 2 * 0.1 * 0.05 = 1e-2, compliance (10 / 180)^2 = 3e-3
  // of an entry of like size, summed over 23 modes.
  EXPECT_LT((-omega * omega * G - mass_line).norm(), 3e-2 * mass_line.norm());
  spec.plant.flexible_modes = 0;
  spec.plant.in_plane_modes.clear();
  for (double& hz : spec.plant.suspension_hz) hz = 0.0;
  const Eigen::MatrixXcd rigid = continuous_response(plant_modes(spec.info, spec.plant), f);
  EXPECT_LT((-omega * omega * rigid - mass_line).norm(), 1e-12 * mass_line.norm());
}

// With sensors at the actuators: symmetric (Maxwell, Betti), and dissipative: Im G is negative
// semidefinite at every positive frequency.
TEST(ContinuousResponse, OfCollocatedChannelsIsReciprocalAndDissipative) {
  test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  spec.info.sensors = spec.info.actuators;
  spec.plant.in_plane_modes.clear();
  const auto modes = plant_modes(spec.info, spec.plant);
  for (const double f : {0.1, 5.0, 180.0, 452.0, 1000.0, 1959.0}) {
    const Eigen::MatrixXcd G = continuous_response(modes, f);
    EXPECT_LT((G - G.transpose()).norm(), 1e-14 * G.norm());
    EXPECT_LT(symmetric_eigen(G.imag()).eigenvalues().maxCoeff(), 1e-12 * G.norm()) << f;
  }
}

// The plate's own rms of every shape is 1/sqrt(mass).
TEST(WaferStageModes, AreAllSeenBySensorsAndDrivenByActuators) {
  const test::SimulatedSpec spec = test::silent_wafer_stage_spec();
  const auto modes = plant_modes(spec.info, spec.plant);
  for (std::size_t i = 6; i < 6 + test::kModesInBand; ++i) {
    const auto rms = [&](const Eigen::VectorXd& shape) {
      return std::sqrt(spec.plant.mass_kg * shape.squaredNorm() /
                       static_cast<double>(shape.size()));
    };
    EXPECT_GT(rms(modes[i].sensor_shape.head(test::kZSensors)), 0.8) << "mode " << i;
    EXPECT_GT(rms(modes[i].actuator_shape.head(test::kZActuators)), 0.55) << "mode " << i;
    EXPECT_EQ(modes[i].sensor_shape.tail(3), Eigen::VectorXd::Zero(3));
    EXPECT_EQ(modes[i].actuator_shape.tail(4), Eigen::VectorXd::Zero(4));
  }
}

TEST(PlantResponse, RefusesWhatHasNone) {
  const auto modes = one_mode(10.0, 0.1);
  EXPECT_THROW(sampled_response({}, 0.0, 1e3, 1.0), std::invalid_argument);
  EXPECT_THROW(sampled_response(one_mode(10.0, 1.0), 0.0, 1e3, 1.0), std::invalid_argument);
  EXPECT_THROW(sampled_response(modes, 0.0, 0.0, 1.0), std::invalid_argument);
  EXPECT_THROW(sampled_response(modes, -1.0, 1e3, 1.0), std::invalid_argument);
}

/// Response of the simulated plant by running it, after its transient.
Eigen::MatrixXcd run_response(const std::vector<PlantMode>& modes, double delay_s, double rate_hz,
                              int line, int period) {
  ModalPlant plant(modes, delay_s, rate_hz);
  Eigen::MatrixXcd response(plant.sensors(), plant.actuators());
  for (Eigen::Index j = 0; j < plant.actuators(); ++j)
    response.col(j) = test::measured_response(plant, Eigen::VectorXd::Unit(plant.actuators(), j),
                                              {line, period, 40});
  return response;
}

// Sensors of position and of acceleration; two methods that share no code.
TEST(PlantResponse, AccelerationsAreExactThroughTheHold) {
  PlantMode one{40.0, 0.1, Eigen::Vector2d(1.0, 0.5), Eigen::Vector2d(0.7, 0.0)};
  PlantMode other{170.0, 0.05, Eigen::Vector2d(-0.3, 1.0), Eigen::Vector2d(0.2, 0.0)};
  one.acceleration_shape = Eigen::Vector2d(0.0, 1.3);
  other.acceleration_shape = Eigen::Vector2d(0.0, -0.8);
  for (const double delay_s : {0.0, 0.4e-3, 2.3e-3}) {
    for (const int line : {3, 20, 77}) {
      const Eigen::MatrixXcd exact =
          sampled_response({one, other}, delay_s, 1000.0, line * 1000.0 / 200.0);
      const Eigen::MatrixXcd run = run_response({one, other}, delay_s, 1000.0, line, 200);
      for (Eigen::Index i = 0; i < 2; ++i)
        EXPECT_LT((run.row(i) - exact.row(i)).norm(), 1e-8 * exact.row(i).norm())
            << delay_s << " " << line;
    }
  }
}

}  // namespace stageid::test_plant_response
