// A mass on the simulated stage, against solutions that share no code with it.
#include "hal/simulator/added_mass.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "hal/simulator/fault_script.hpp"
#include "tests/hal/stage_bench.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_added_mass {

using Kind = SimulationSpec::Fault::Kind;
constexpr double kTurn = 2.0 * std::numbers::pi;

Eigen::VectorXd shape_of(const std::vector<PlantMode>& modes, Eigen::Index actuator) {
  Eigen::VectorXd shape(std::ssize(modes));
  for (Eigen::Index i = 0; i < shape.size(); ++i) shape[i] = modes[i].actuator_shape[actuator];
  return shape;
}

/// Sum over the modes, at s = j omega.
std::complex<double> receptance(const std::vector<PlantMode>& modes, const Eigen::VectorXd& out,
                                const Eigen::VectorXd& in, double hz) {
  std::complex<double> sum = 0.0;
  const std::complex<double> s(0.0, kTurn * hz);
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const double omega = kTurn * modes[i].natural_frequency_hz;
    sum += out[i] * in[i] / (s * s + 2.0 * modes[i].damping_ratio * omega * s + omega * omega);
  }
  return sum;
}

TEST(AddedMass, OnARigidBodyOnASpring) {
  const Eigen::VectorXd shape = Eigen::VectorXd::Constant(1, 1.0 / std::sqrt(8.0));
  const std::vector<PlantMode> modes = {{5.0, 0.1, shape, shape}};
  const LoadedModes loaded = loaded_modes(modes, shape, 1.0);
  // k and c stay: omega' = omega sqrt(8/9), zeta' = zeta sqrt(8/9).
  EXPECT_NEAR(loaded.modes[0].natural_frequency_hz, 5.0 * std::sqrt(8.0 / 9.0), 1e-14);
  EXPECT_NEAR(loaded.modes[0].damping_ratio, 0.1 * std::sqrt(8.0 / 9.0), 1e-15);
  EXPECT_NEAR(std::abs(loaded.modes[0].sensor_shape[0]), 1.0 / 3.0, 1e-15);
}

// The mass m answers the motion of its point by the force -m s^2 x.
TEST(AddedMass, ChangesTheResponseAsTheForceOfTheMassDoes) {
  test::SimulatedSpec spec = test::wafer_stage_spec();
  std::vector<PlantMode> modes = plant_modes(spec.info, spec.plant);
  for (PlantMode& mode : modes) mode.damping_ratio = 0.0;  // no coupling by damping
  const Eigen::Index at = 3;
  const double mass_kg = 0.5;
  const Eigen::VectorXd p = shape_of(modes, at);
  const LoadedModes loaded = loaded_modes(modes, p, mass_kg);
  Eigen::VectorXd y(p.size()), y_loaded(p.size());
  for (Eigen::Index i = 0; i < p.size(); ++i) {
    y[i] = modes[i].sensor_shape[1];
    y_loaded[i] = loaded.modes[i].sensor_shape[1];
  }
  const Eigen::VectorXd u = shape_of(modes, 0);
  const Eigen::VectorXd u_loaded = shape_of(loaded.modes, 0);
  for (const double hz : {1.0, 47.0, 210.0, 333.0, 811.0, 1490.0, 3000.0}) {
    const double s2 = -std::pow(kTurn * hz, 2);
    const auto expected = receptance(modes, y, u, hz) -
                          receptance(modes, y, p, hz) * mass_kg * s2 * receptance(modes, p, u, hz) /
                              (1.0 + mass_kg * s2 * receptance(modes, p, p, hz));
    // Rounding of omega^2 relative to the largest, (2700 Hz)^2: 1e-16 * 7e6 / 1 Hz^2 at 1 Hz. Margin: 10.
    EXPECT_LT(std::abs(receptance(loaded.modes, y_loaded, u_loaded, hz) - expected),
              1e-8 * std::abs(expected))
        << hz;
  }
}

TEST(AddedMass, TheBasisIsInverted) {
  const test::SimulatedSpec spec = test::wafer_stage_spec();
  const std::vector<PlantMode> modes = plant_modes(spec.info, spec.plant);
  const LoadedModes loaded = loaded_modes(modes, shape_of(modes, 2), 3.0);
  const Eigen::Index n = loaded.basis.rows();
  EXPECT_LT((loaded.basis * loaded.inverse - Eigen::MatrixXd::Identity(n, n)).norm(), 1e-12);
}

/// Motion of all modes in the coordinates without the mass.
class Reference {
 public:
  Reference(const test::SimulatedSpec& spec, Eigen::Index actuator)
      : modes_(plant_modes(spec.info, spec.plant)),
        at_(shape_of(modes_, actuator)),
        q_(Eigen::VectorXd::Zero(at_.size())),
        v_(q_) {}

  void advance(double mass_kg, const Eigen::VectorXd& force, double duration_s) {
    const Eigen::Index n = q_.size();
    const Eigen::MatrixXd M = Eigen::MatrixXd::Identity(n, n) + mass_kg * at_ * at_.transpose();
    Eigen::VectorXd omega(n), damping(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const PlantMode& mode = modes_[i];
      omega[i] = kTurn * mode.natural_frequency_hz;
      damping[i] = 2.0 * mode.damping_ratio * omega[i];
    }
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        omega.cwiseAbs2().asDiagonal().toDenseMatrix(), M);
    const Eigen::MatrixXd& V = eigen.eigenvectors();
    Eigen::VectorXd q = V.transpose() * M * q_, v = V.transpose() * M * v_;
    const Eigen::VectorXd f = V.transpose() * force;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double decay = 0.5 * V.col(i).cwiseAbs2().dot(damping);
      const double square = eigen.eigenvalues()[i];
      const double omega_d = std::sqrt(square - decay * decay);
      const double rest = f[i] / square;
      const double a = q[i] - rest, b = (v[i] + decay * a) / omega_d;
      const double e = std::exp(-decay * duration_s);
      const double c = std::cos(omega_d * duration_s), s = std::sin(omega_d * duration_s);
      q[i] = rest + e * (a * c + b * s);
      v[i] = e * ((b * omega_d - decay * a) * c - (a * omega_d + decay * b) * s);
    }
    q_ = V * q;
    v_ = V * v;
  }
  Eigen::VectorXd force(const std::vector<double>& u) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(q_.size());
    for (std::size_t j = 0; j < u.size(); ++j)
      sum += u[j] * shape_of(modes_, static_cast<Eigen::Index>(j));
    return sum;
  }
  double sensor() const {
    double sum = 0.0;
    for (Eigen::Index i = 0; i < q_.size(); ++i) sum += modes_[i].sensor_shape[0] * q_[i];
    return sum;
  }

 private:
  std::vector<PlantMode> modes_;
  Eigen::VectorXd at_, q_, v_;
};

void expect_motion(double ramp_s) {
  constexpr int kFrom = 100, kCycles = 300;
  constexpr double kMass = 0.7;
  test::SimulatedSpec spec = test::small_stage_spec();
  const double period_s = 1.0 / spec.info.sample_rate_hz;
  spec.info.delay_s = 0.4 * period_s;
  spec.simulation.faults = {{Kind::added_mass, 1, kFrom, 1, -1, kMass, ramp_s}};
  test::Bench bench(spec);
  // The second run begins without the mass again.
  for (int repetition = 0; repetition < 2; ++repetition) {
    Reference reference(spec, 1);
    bench.start();
    std::vector<double> last = {0.0, 0.0};
    double largest = 0.0, difference = 0.0;
    for (int n = 0; n < kCycles; ++n) {
      const double grown =
          ramp_s == 0.0 ? 1.0 : std::min(1.0, (n - kFrom + 0.5) * period_s / ramp_s);
      const double steps = ramp_s == 0.0 ? 1.0 : FaultScript::kMassSteps;
      const double mass_kg = n < kFrom ? 0.0 : kMass * std::round(grown * steps) / steps;
      const std::vector<double> u = {std::sin(0.37 * n), std::sin(0.37 * n + 1.0)};
      bench.u = u;
      ASSERT_EQ(bench.step(), Outcome::ok);
      reference.advance(mass_kg, reference.force(last), spec.info.delay_s);
      reference.advance(mass_kg, reference.force(u), period_s - spec.info.delay_s);
      last = u;
      largest = std::max(largest, std::abs(reference.sensor()));
      difference = std::max(difference, std::abs(reference.sensor() - bench.y[0]));
    }
    // Both round omega^2 of the suspension relative to that of the flexible mode, and 300 cycles add up.
    EXPECT_LT(difference, 1e-9 * largest);
  }
}

TEST(AddedMass, AStepContinuesTheMotion) { expect_motion(0.0); }
TEST(AddedMass, ARampContinuesTheMotion) { expect_motion(0.05); }

TEST(AddedMass, RefusesWhatHasNoMeaning) {
  test::SimulatedSpec spec = test::small_stage_spec();
  const auto refuse = [&](const char* part) {
    EXPECT_THAT([&] { test::simulated(spec); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr(part)));
  };
  const SimulationSpec::Fault mass = {Kind::added_mass, 0, 0, 1, -1, 0.5};
  spec.simulation.faults = {mass, mass};
  refuse("only one");
  spec.simulation.faults = {{Kind::added_mass, 0, 0, 1, -1, -1000.0}};
  refuse("must be above");
  spec.simulation.faults = {mass};
  spec.plant.cubic_stiffness_n_m3 = 1.0;
  refuse("linear");
  spec.plant.cubic_stiffness_n_m3 = 0.0;
  spec.plant.suspension_hz[0] = 0.0;
  refuse("suspension_hz");
}

}  // namespace stageid::test_added_mass
