#include "tests/support/judgement/judgement_stage.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "excitation/decompositions/decompositions.hpp"
#include "hal/simulator/modal_plant.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kSuspensionHz =
    0.02;  // far below all lines: weak per line, but together enough to shift a delay
constexpr double kDecayed = 1e-5;

struct Sizes {
  int sensors = 2;
  int actuators = 2;
  bool in_plane = false;
};

Sizes draw_sizes(RandomNumbers& random) {
  Sizes sizes;
  sizes.sensors = random.integer(2, 7);
  const int most = sizes.sensors == 2 ? 4 : sizes.sensors < 6 ? 10 : 17;
  const int least = sizes.sensors == 2 ? 2 : sizes.sensors < 6 ? 3 : 7;
  sizes.actuators = random.integer(least, most);
  sizes.in_plane = sizes.sensors >= 6;
  return sizes;
}

Channel channel(const std::string& name, const char* unit, double x_m, double y_m, int axis) {
  Channel c{name, unit, {x_m, y_m, 0.0}, {0.0, 0.0, 0.0}};
  c.direction[axis] = 1.0;
  return c;
}

/// Vertical channels on the plate: on the line x = 0 with `line`, else around its edge.
void place_vertical(RandomNumbers& random, const char* prefix, const char* unit, int count,
                    bool line, const PlantSpec& plant, std::vector<Channel>& channels) {
  for (int i = 0; i < count; ++i) {
    const std::string name = fmt::format("{}{}", prefix, i + 1);
    if (line) {
      const double y =
          plant.length_y_m * (-0.45 + 0.9 * i / (count - 1.0)) * random.uniform(0.8, 1.0);
      channels.push_back(channel(name, unit, 0.0, y, 2));
      continue;
    }
    const double angle = 2.0 * kPi * (i + random.uniform(-0.2, 0.2)) / count + 0.4;
    const double radius = i < 4 ? random.uniform(0.38, 0.48) : random.uniform(0.1, 0.48);
    channels.push_back(channel(name, unit, radius * plant.length_x_m * std::cos(angle),
                               radius * plant.length_y_m * std::sin(angle), 2));
  }
}

/// Three sensors, three or four actuators in the plane: x, y and Rz can be distinguished.
void place_in_plane(RandomNumbers& random, const char* prefix, const char* unit, int count,
                    const PlantSpec& plant, std::vector<Channel>& channels) {
  const double a = 0.4 * plant.length_x_m * random.uniform(0.8, 1.0);
  const double b = 0.4 * plant.length_y_m * random.uniform(0.8, 1.0);
  const std::array<std::array<double, 2>, 4> at = {{{0.0, -b}, {0.0, b}, {a, 0.0}, {-a, 0.0}}};
  for (int i = 0; i < count; ++i)
    channels.push_back(
        channel(fmt::format("{}h{}", prefix, i + 1), unit, at[i][0], at[i][1], i < 2 ? 0 : 1));
}

void draw_body(RandomNumbers& random, const Sizes& sizes, SimulatedSpec& spec) {
  PlantSpec& plant = spec.plant;
  spec.info.name = "random stage";
  spec.info.backend = "sim";
  const std::array<double, 3> rates = {1000.0, 2000.0, 4000.0};
  spec.info.sample_rate_hz = rates[random.integer(0, 2)];
  plant.mass_kg = random.uniform(5.0, 30.0);
  plant.length_x_m = random.uniform(0.4, 0.8);
  plant.length_y_m = plant.length_x_m * random.uniform(0.7, 1.3);
  const double thickness_m = 0.1;
  const auto inertia = [&](double a, double b) {
    return plant.mass_kg * (std::pow(a, 2) + std::pow(b, 2)) / 12.0;
  };
  plant.inertia_kg_m2[0] = inertia(plant.length_y_m, thickness_m);
  plant.inertia_kg_m2[1] = inertia(plant.length_x_m, thickness_m);
  plant.inertia_kg_m2[2] = inertia(plant.length_x_m, plant.length_y_m);
  for (double& hz : plant.suspension_hz) hz = kSuspensionHz;
  plant.suspension_damping = 0.1;
  const int plane_sensors = sizes.in_plane ? 3 : 0;
  const int plane_actuators = sizes.in_plane ? (sizes.actuators > 7 ? 4 : 3) : 0;
  place_vertical(random, "z", "m", sizes.sensors - plane_sensors, sizes.sensors == 2, plant,
                 spec.info.sensors);
  place_in_plane(random, "z", "m", plane_sensors, plant, spec.info.sensors);
  place_vertical(random, "a", "N", sizes.actuators - plane_actuators, sizes.sensors == 2, plant,
                 spec.info.actuators);
  place_in_plane(random, "a", "N", plane_actuators, plant, spec.info.actuators);
  spec.info.delay_s = random.uniform(0.3, 1.7) / spec.info.sample_rate_hz;
}

/// `count` frequencies of the band, at least three half-power widths apart, and one or two above it.
void draw_modes(RandomNumbers& random, int count, JudgementStage& stage) {
  SimulatedSpec& spec = stage.spec;
  std::vector<PlantMode>& modes = spec.plant.in_plane_modes;
  const auto crowded = [&](double hz, double damping) {
    return std::any_of(modes.begin(), modes.end(), [&](const PlantMode& other) {
      const double width =
          2.0 * std::max(damping * hz, other.damping_ratio * other.natural_frequency_hz);
      return std::abs(other.natural_frequency_hz - hz) < 3.0 * width;
    });
  };
  const auto add = [&](double hz, double damping) {
    const double scale = random.uniform(0.3, 0.8) / std::sqrt(spec.plant.mass_kg);
    modes.push_back({hz, damping, random_vector(random, spec.info.actuators.size(), scale),
                     random_vector(random, spec.info.sensors.size(), scale)});
  };
  const double first_hz = 0.2 * stage.band_high_hz;
  const double last_hz = 0.93 * stage.band_high_hz;
  for (int trials = 0; static_cast<int>(modes.size()) < count; ++trials) {
    if (trials % 100 == 99) modes.clear();  // those drawn may leave no room
    const double hz = random.uniform(first_hz, last_hz);
    const double damping = 0.005 * std::pow(4.0, random.uniform());
    if (!crowded(hz, damping)) add(hz, damping);
  }
  stage.modes_in_band = count;
  const int above = random.integer(1, 2);
  for (int i = 0; i < above; ++i)
    add(stage.band_high_hz * (1.3 + 0.5 * i + random.uniform(0.0, 0.3)),
        random.uniform(0.007, 0.03));
}

MotionControllerSpec controller(const SimulatedSpec& spec, const Sizes& sizes,
                                double crossover_hz) {
  AxisController axis;
  axis.crossover_hz = crossover_hz;
  axis.integrator_hz = crossover_hz / 10.0;
  axis.lead_zero_hz = crossover_hz / 3.0;
  axis.lead_pole_hz = crossover_hz * 4.0;
  axis.lowpass_hz = crossover_hz * 8.0;
  const AxisController open;
  const AxisController plane = sizes.in_plane ? axis : open;
  const AxisController pitch = sizes.sensors == 2 ? open : axis;
  return motion_controller_spec(spec.info.sample_rate_hz, spec.info.actuators, spec.info.sensors,
                                {plane, plane, axis, axis, pitch, plane},
                                spec.plant.axis_inertia());
}

/// Samples until a kick at all actuators has decayed to kDecayed of its largest motion, in the sensors and in each
/// flexible mode; -1: it does not within `most`.
int settling_samples(const SimulatedSpec& spec, int most) {
  ModalPlant plant(plant_modes(spec.info, spec.plant), spec.info.delay_s, spec.info.sample_rate_hz);
  MotionController loop(spec.controller);
  Eigen::VectorXd y(plant.sensors());
  Eigen::VectorXd u(plant.actuators());
  const auto modes = static_cast<Eigen::Index>(spec.plant.in_plane_modes.size());
  Eigen::ArrayXXd motion(1 + modes, most);  // of the sensors, of each mode
  for (int n = 0; n < most; ++n) {
    plant.output(y.data());
    motion(0, n) = y.cwiseAbs().maxCoeff();
    for (Eigen::Index i = 0; i < modes; ++i)
      motion(1 + i, n) = std::abs(plant.coordinate(static_cast<Eigen::Index>(kRigidAxes) + i));
    if (!(motion(0, n) < 1e6)) return -1;
    loop.update(y.data(), u.data());
    if (n == 0)
      for (Eigen::Index i = 0; i < u.size(); ++i) u[i] += 1.0 + 0.3 * static_cast<double>(i % 3);
    plant.step(u.data());
  }
  const Eigen::ArrayXd small = kDecayed * motion.rowwise().maxCoeff();
  int last = most - 1;
  while (last > 0 && (motion.col(last) < small).all()) --last;
  return last > most * 3 / 4 ? -1 : last;
}

void close_loop(RandomNumbers& random, const Sizes& sizes, JudgementStage& stage) {
  double crossover_hz = stage.band_high_hz * random.uniform(0.04, 0.07);
  for (int trial = 0; trial < 20; ++trial, crossover_hz *= 0.85) {
    stage.spec.controller = controller(stage.spec, sizes, crossover_hz);
    const int settled = settling_samples(stage.spec, 8 * stage.period_samples);
    if (settled < 0) continue;
    stage.transient_periods = 1 + settled / stage.period_samples;
    return;
  }
  throw std::runtime_error(fmt::format("judgement stage {}: no stable loop", stage.seed));
}

/// Sensor noise by the response's: of the mean over all periods and fitted realizations, single axis; orthogonal
/// axes have sqrt(n) less.
void draw_noise(RandomNumbers& random, JudgementStage& stage) {
  SimulatedSpec& spec = stage.spec;
  const Eigen::VectorXd frequency_hz = stage.plan().grid().frequency_hz();
  const std::vector<PlantMode> modes = plant_modes(spec.info, spec.plant);
  std::vector<double> magnitudes;
  for (Eigen::Index k = 0; k < frequency_hz.size(); k += 5) {
    const Eigen::MatrixXcd g =
        sampled_response(modes, spec.info.delay_s, spec.info.sample_rate_hz, frequency_hz[k]);
    for (Eigen::Index c = 0; c < g.size(); ++c) magnitudes.push_back(std::abs(g(c)));
  }
  std::sort(magnitudes.begin(), magnitudes.end());
  const double median = magnitudes[magnitudes.size() / 2];
  stage.snr_db = random.uniform(30.0, 50.0);
  double response_noise = median * std::pow(10.0, -stage.snr_db / 20.0);
  for (int i = 0; i < stage.modes_in_band; ++i) {
    const PlantMode& mode = spec.plant.in_plane_modes[i];
    const double omega = 2.0 * kPi * mode.natural_frequency_hz;
    const double peak = mode.actuator_shape.cwiseAbs().maxCoeff() *
                        mode.sensor_shape.cwiseAbs().maxCoeff() /
                        (2.0 * mode.damping_ratio * omega * omega);
    response_noise = std::min(response_noise, 0.1 * peak);
  }
  stage.snr_db = 20.0 * std::log10(median / response_noise);
  const double means = stage.periods * (stage.realizations - 1.0);
  const double white =
      response_noise * stage.level_n *
      std::sqrt(means * stage.period_samples / (2.0 * static_cast<double>(frequency_hz.size())));
  const double density = 2.0 * white * white / spec.info.sample_rate_hz;
  stage.noise.colour = static_cast<NoiseColour>(random.integer(0, 3));
  stage.noise.channels = static_cast<Eigen::Index>(spec.info.sensors.size());
  stage.noise.sample_rate_hz = spec.info.sample_rate_hz;
  stage.noise.damping_ratio = random.uniform(0.005, 0.03);
  stage.noise.reference_hz = stage.band_high_hz * random.uniform(0.15, 0.9);
  stage.noise.density = density;
  spec.simulation.sensor_noise_m = white;
  if (stage.noise.colour == NoiseColour::white) stage.noise.density = 0.0;
  if (stage.noise.colour == NoiseColour::resonant) stage.noise.density *= 30.0;
  if (stage.noise.colour == NoiseColour::flicker) {
    stage.noise.reference_hz = 0.2 * stage.band_high_hz;
    spec.simulation.sensor_noise_m *= 0.5;
  }
  // What leaks from a random walk is common to all lines: a trouble of its own unless it is below the white noise.
  if (stage.noise.colour == NoiseColour::drift) stage.noise.reference_hz = 1.5 * stage.band_low_hz;
  // Half of the stages feel forces too: as much as the sensors' noise at 30 % of the band.
  if (random.uniform() < 0.5) {
    const Eigen::MatrixXcd g = sampled_response(modes, spec.info.delay_s, spec.info.sample_rate_hz,
                                                0.3 * stage.band_high_hz);
    spec.simulation.force_noise_n = white / std::sqrt(g.cwiseAbs2().rowwise().sum().mean());
  }
}

/// Rms of the rigid heave in a run, by the closed loop's response to the excitation.
double heave_motion(const JudgementStage& stage) {
  constexpr std::size_t kHeave = 2;
  const SimulatedSpec& spec = stage.spec;
  const Eigen::VectorXd frequency_hz = stage.plan().grid().frequency_hz();
  const std::vector<PlantMode> modes = plant_modes(spec.info, spec.plant);
  const MotionController loop(spec.controller);
  const auto axes = static_cast<Eigen::Index>(spec.info.actuators.size());
  double power = 0.0;
  for (const double hz : frequency_hz) {
    const Eigen::MatrixXcd g =
        sampled_response(modes, spec.info.delay_s, spec.info.sample_rate_hz, hz);
    const Eigen::MatrixXcd u =
        inverse(Eigen::MatrixXcd::Identity(axes, axes) - loop.response(hz) * g);
    const double omega = 2.0 * kPi * hz;
    power += (modes[kHeave].actuator_shape.transpose() * u).squaredNorm() /
             (spec.plant.mass_kg * std::pow(omega, 4));
  }
  const double runs =
      stage.scheme == ExcitationScheme::single_axis ? static_cast<double>(axes) : 1.0;
  return stage.level_n * std::sqrt(power / (static_cast<double>(frequency_hz.size()) * runs));
}

std::string channel_text(const Channel& c, const char* rest) {
  return fmt::format("  - {{name: {}, unit: {}, position_m: [{}], direction: [{}], {}}}\n", c.name,
                     c.unit, fmt::join(c.position_m, ", "), fmt::join(c.direction, ", "), rest);
}

}  // namespace

ExperimentPlan JudgementStage::plan() const {
  ExperimentSpec experiment;
  experiment.scheme = scheme;
  experiment.realizations = realizations;
  experiment.periods = periods;
  experiment.transient_periods = transient_periods;
  experiment.seed = seed;
  for (const Channel& c : spec.info.actuators) experiment.axes.push_back({c.name, level_n});
  return ExperimentPlan(FrequencyGrid::band(spec.info.sample_rate_hz, period_samples,
                                            {.low_hz = band_low_hz, .high_hz = band_high_hz}),
                        experiment);
}

std::string JudgementStage::nominal_text() const {
  RandomNumbers random(seed + 0x51a9e);
  const auto off = [&](double value) { return value * random.uniform(0.98, 1.02); };
  std::string text = fmt::format(
      "format: stageid-stage\nname: {}\nbackend: sim\nsample_rate_hz: {}\ndelay_s: "
      "{}\nactuators:\n",
      spec.info.name, spec.info.sample_rate_hz, spec.info.delay_s);
  for (const Channel& c : spec.info.actuators)
    text += channel_text(c, "limit_n: 1000, thermal_rms_n: 1000");
  text += "sensors:\n";
  for (const Channel& c : spec.info.sensors) text += channel_text(c, "window_m: 1");
  text += fmt::format(
      "plant:\n  mass_kg: {}\n  inertia_kg_m2: [{}, {}, {}]\n  suspension_hz: [{}]\n"
      "  suspension_damping: {}\n  plate: {{length_x_m: {}, length_y_m: {}, first_mode_hz: 100, "
      "modes: 0, damping: [0.01]}}\n",
      off(spec.plant.mass_kg), off(spec.plant.inertia_kg_m2[0]), off(spec.plant.inertia_kg_m2[1]),
      off(spec.plant.inertia_kg_m2[2]), fmt::join(spec.plant.suspension_hz, ", "),
      spec.plant.suspension_damping, spec.plant.length_x_m, spec.plant.length_y_m);
  text += "controller:\n";
  for (std::size_t i = 0; i < kRigidAxes; ++i) {
    const AxisController& axis = spec.controller.axes[i];
    if (axis.crossover_hz == 0.0) continue;
    text += fmt::format(
        "  {}: {{crossover_hz: {}, gain: {}, integrator_hz: {}, lead_zero_hz: {}, lead_pole_hz: "
        "{}, lowpass_hz: {}, lowpass_damping: {}}}\n",
        kRigidAxisNames[i], axis.crossover_hz, axis.gain, axis.integrator_hz, axis.lead_zero_hz,
        axis.lead_pole_hz, axis.lowpass_hz, axis.lowpass_damping);
  }
  return text;
}

std::string JudgementStage::description() const {
  return fmt::format("{} x {}, {} modes, {:.0f} dB, {} noise, {}, {} Hz, settles in {} periods",
                     spec.info.sensors.size(), spec.info.actuators.size(), modes_in_band, snr_db,
                     to_string(noise.colour),
                     scheme == ExcitationScheme::single_axis ? "single axis" : "orthogonal",
                     spec.info.sample_rate_hz, transient_periods);
}

JudgementStage draw_judgement_stage(std::uint64_t seed) {
  RandomNumbers random(seed * 0x2545f491ULL + 17);
  JudgementStage stage;
  stage.seed = seed;
  const Sizes sizes = draw_sizes(random);
  draw_body(random, sizes, stage.spec);
  const int channels = sizes.sensors * sizes.actuators;
  const bool large = channels > 30;
  stage.period_samples = large ? 2000 : 500 * random.integer(6, 8);
  stage.band_low_hz = 0.006 * stage.spec.info.sample_rate_hz;
  stage.band_high_hz = (large ? 0.15 : 0.18) * stage.spec.info.sample_rate_hz;
  stage.realizations = channels <= 9 ? 4 : 3;
  stage.scheme =
      random.uniform() < 0.5 ? ExcitationScheme::single_axis : ExcitationScheme::orthogonal_dft;
  stage.stage_file = random.uniform() < 0.5;
  draw_modes(random, large ? random.integer(4, 6) : random.integer(5, 8), stage);
  close_loop(random, sizes, stage);
  draw_noise(random, stage);
  stage.motion_m = heave_motion(stage);
  return stage;
}

}  // namespace stageid::test
