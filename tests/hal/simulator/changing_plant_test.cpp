// The simulated stage while its modes change, against solutions that share no code with it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "tests/hal/stage_bench.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test_changing_plant {

using Fault = SimulationSpec::Fault;
using Kind = Fault::Kind;
using test::Bench;

constexpr int kFlexible = 6;  // the only flexible mode of the small stage

struct Motion {
  double q = 0.0;
  double v = 0.0;
};

/// q'' + 2 zeta omega q' + omega^2 q = force, in closed form for zeta < 1.
Motion advance(const Motion& from, double omega, double zeta, double force, double duration_s) {
  const double rest = force / (omega * omega);
  const double decay = zeta * omega;
  const double omega_d = omega * std::sqrt(1.0 - zeta * zeta);
  const double a = from.q - rest;
  const double b = (from.v + decay * a) / omega_d;
  const double e = std::exp(-decay * duration_s);
  const double c = std::cos(omega_d * duration_s);
  const double s = std::sin(omega_d * duration_s);
  return {rest + e * (a * c + b * s),
          e * ((b * omega_d - decay * a) * c - (a * omega_d + decay * b) * s)};
}

/// Factors of natural frequency and damping ratio of a mode in a cycle.
struct Factors {
  double frequency = 1.0;
  double damping = 1.0;
};
using Truth = std::function<Factors(int mode, int cycle)>;

double command(int actuator, int n) { return std::sin(0.37 * n + actuator) + (n == 3 ? 2.0 : 0.0); }

double acting_force(const PlantMode& mode, int n) {
  double force = 0.0;
  if (n < 0) return force;
  for (int j = 0; j < mode.actuator_shape.size(); ++j)
    force += mode.actuator_shape[j] * command(j, n);
  return force;
}

/// The sensor of the small stage at t_1 ... t_cycles. Before t_n + delay, u[n-1] acts; then u[n].
std::vector<double> reference(const test::SimulatedSpec& spec, const Truth& truth, int cycles) {
  const double period_s = 1.0 / spec.info.sample_rate_hz;
  std::vector<double> y(cycles);
  const std::vector<PlantMode> modes = plant_modes(spec.info, spec.plant);
  for (int m = 0; m < static_cast<int>(modes.size()); ++m) {
    const PlantMode& mode = modes[m];
    Motion motion;
    for (int n = 0; n < cycles; ++n) {
      const Factors factors = truth(m, n);
      const double omega = 2.0 * std::numbers::pi * mode.natural_frequency_hz * factors.frequency;
      const double zeta = mode.damping_ratio * factors.damping;
      motion = advance(motion, omega, zeta, acting_force(mode, n - 1), spec.info.delay_s);
      motion = advance(motion, omega, zeta, acting_force(mode, n), period_s - spec.info.delay_s);
      y[n] += mode.sensor_shape[0] * motion.q;
    }
  }
  return y;
}

test::SimulatedSpec with_faults(std::vector<Fault> faults, double delay_s = 0.4e-3) {
  test::SimulatedSpec spec = test::small_stage_spec();
  spec.info.delay_s = delay_s;
  spec.simulation.faults = std::move(faults);
  return spec;
}

std::vector<double> run(Bench& bench, int cycles) {
  std::vector<double> y;
  bench.start();
  for (int n = 0; n < cycles; ++n) {
    bench.u = {command(0, n), command(1, n)};
    EXPECT_EQ(bench.step(), Outcome::ok);
    y.push_back(bench.y[0]);
  }
  return y;
}

double largest(const std::vector<double>& y) {
  double value = 0.0;
  for (const double x : y) value = std::max(value, std::abs(x));
  return value;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double value = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) value = std::max(value, std::abs(a[i] - b[i]));
  return value;
}

// Rounding accumulates over 300 cycles: 300 eps = 7e-14 of the largest value. Margin: 10.
constexpr double kRounding = 1e-12;

void expect_truth(const test::SimulatedSpec& spec, const Truth& truth) {
  constexpr int kCycles = 300;
  Bench bench(spec);
  const std::vector<double> expected = reference(spec, truth, kCycles);
  // Every run starts with the plant of the file.
  for (int repetition = 0; repetition < 2; ++repetition)
    EXPECT_LT(largest_difference(run(bench, kCycles), expected), kRounding * largest(expected));
}

TEST(ChangingPlant, WithoutAChangeTheReferenceIsTheStage) {
  expect_truth(with_faults({}), [](int, int) { return Factors(); });
}

TEST(ChangingPlant, AStepOfANaturalFrequencyContinuesTheMotion) {
  for (const double delay_s : {0.0, 0.4e-3, 1e-3})
    expect_truth(with_faults({{Kind::mode_frequency, kFlexible, 100, 1, -1, -0.07}}, delay_s),
                 [](int m, int n) {
                   return Factors{m == kFlexible && n >= 100 ? 0.93 : 1.0, 1.0};
                 });
}

TEST(ChangingPlant, AStepOfADampingRatioContinuesTheMotion) {
  expect_truth(with_faults({{Kind::mode_damping, 2, 50, 1, -1, 4.0}}), [](int m, int n) {
    return Factors{1.0, m == 2 && n >= 50 ? 5.0 : 1.0};
  });
}

TEST(ChangingPlant, AllFlexibleModesAreNotTheSuspension) {
  expect_truth(with_faults({{Kind::mode_frequency, -1, 0, 1, -1, 0.1}}), [](int m, int) {
    return Factors{m >= kFlexible ? 1.1 : 1.0, 1.0};
  });
}

// Over 20 cycles from the 40th: in each cycle the mean of the ramp.
TEST(ChangingPlant, ARampStartsAndEndsAtItsCycles) {
  const auto grown = [](int n) { return std::clamp((n - 40 + 0.5) / 20.0, 0.0, 1.0); };
  expect_truth(with_faults({{Kind::mode_frequency, kFlexible, 40, 1, -1, 0.2, 0.02},
                            {Kind::mode_damping, kFlexible, 40, 1, -1, -0.5, 0.02}}),
               [&](int m, int n) {
                 const double g = m == kFlexible ? grown(n) : 0.0;
                 return Factors{1.0 + 0.2 * g, 1.0 - 0.5 * g};
               });
}

TEST(ChangingPlant, ChangesOfOneModeMultiply) {
  expect_truth(with_faults({{Kind::mode_frequency, kFlexible, 40, 1, -1, 0.2},
                            {Kind::mode_frequency, -1, 90, 1, -1, -0.1}}),
               [](int m, int n) {
                 if (m != kFlexible) return Factors();
                 return Factors{(n >= 40 ? 1.2 : 1.0) * (n >= 90 ? 0.9 : 1.0), 1.0};
               });
}

/// The same motion by Runge-Kutta steps while the natural frequency grows without steps, `late` cycles after the fault.
std::vector<double> integrated(const test::SimulatedSpec& spec, const Fault& ramp, double late,
                               int cycles) {
  const double period_s = 1.0 / spec.info.sample_rate_hz;
  std::vector<double> y(cycles);
  const std::vector<PlantMode> modes = plant_modes(spec.info, spec.plant);
  for (int m = 0; m < static_cast<int>(modes.size()); ++m) {
    const PlantMode& mode = modes[m];
    const double start_s = (static_cast<double>(ramp.from_cycle) + late) * period_s;
    const auto slope = [&](const Motion& x, double t_s, double force) {
      const double grown = std::clamp((t_s - start_s) / ramp.ramp_s, 0.0, 1.0);
      const double omega = 2.0 * std::numbers::pi * mode.natural_frequency_hz *
                           (1.0 + (m == ramp.channel ? ramp.value * grown : 0.0));
      return Motion{x.v, force - 2.0 * mode.damping_ratio * omega * x.v - omega * omega * x.q};
    };
    const auto moved = [](const Motion& x, const Motion& d, double h) {
      return Motion{x.q + h * d.q, x.v + h * d.v};
    };
    Motion x;
    constexpr int kSteps = 4;
    const double h = period_s / kSteps;
    for (int n = 0; n < cycles; ++n) {
      const double force = acting_force(mode, n);
      for (int i = 0; i < kSteps; ++i) {
        const double t_s = n * period_s + i * h;
        const Motion a = slope(x, t_s, force);
        const Motion b = slope(moved(x, a, 0.5 * h), t_s + 0.5 * h, force);
        const Motion c = slope(moved(x, b, 0.5 * h), t_s + 0.5 * h, force);
        const Motion d = slope(moved(x, c, h), t_s + h, force);
        x.q += h / 6.0 * (a.q + 2.0 * b.q + 2.0 * c.q + d.q);
        x.v += h / 6.0 * (a.v + 2.0 * b.v + 2.0 * c.v + d.v);
      }
      y[n] += mode.sensor_shape[0] * x.q;
    }
  }
  return y;
}

// One constant value per cycle leaves out the Magnus term (omega T)^2 value / 6, and half a cycle too late gives a phase
// of omega T value / 2: the ratio is omega T / 3 = 0.008 for 80 Hz at 20 kHz. Margin: 3.
TEST(ChangingPlant, ARampIsTheIntegralOfTheChangingOscillator) {
  const Fault ramp{Kind::mode_frequency, kFlexible, 100, 1, -1, 0.1, 0.03};
  test::SimulatedSpec spec = with_faults({ramp}, 0.0);
  spec.info.sample_rate_hz = 20e3;
  constexpr int kCycles = 1500;
  Bench bench(spec);
  const std::vector<double> expected = integrated(spec, ramp, 0.0, kCycles);
  const double half_a_cycle = largest_difference(integrated(spec, ramp, 0.5, kCycles), expected);
  EXPECT_LT(largest_difference(run(bench, kCycles), expected), 0.025 * half_a_cycle);
}

}  // namespace stageid::test_changing_plant
