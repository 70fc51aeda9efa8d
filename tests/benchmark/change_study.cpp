// Names of changes of random stages: planted against told.
//
//   change_study [stages = 25] [first seed = 1] [size = 8] [kind = all]
//
// Every stage (2 x 2 to 7 x 17 channels, judgement_stage.hpp) is watched around its exact model under a multisine on all
// axes at once, and changed in each of 12 ways. Small changes are `size` times the standard deviation that 4
// periods give. Prints every change that is not told, or told by another name, then a table.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "estimation/tracking/model_tracker.hpp"
#include "excitation/multisine/multisine.hpp"
#include "hal/simulator/plant_spec.hpp"
#include "tests/support/judgement/judgement_stage.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/stages/excited_loop.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

using Fault = SimulationSpec::Fault;

constexpr int kLearning = 32;
constexpr int kBefore = 8;  // watched periods before the change
constexpr int kAfter = 40;
constexpr double kFalseAlarms = 1e-6;  // per period

/// The plant itself, mode by mode.
AdditiveModel exact_model(const JudgementStage& stage) {
  const StageInfo& info = stage.spec.info;
  AdditiveModel model;
  for (const auto& [channels, list] :
       {std::pair{&info.actuators, &model.inputs}, {&info.sensors, &model.outputs}})
    for (const Channel& channel : *channels) {
      list->names.push_back(channel.name);
      list->units.push_back(channel.unit);
    }
  model.sample_rate_hz = info.sample_rate_hz;
  model.hold = HoldModel::exact;
  model.output_delay_s = Eigen::VectorXd::Constant(model.n_outputs(), info.delay_s);
  for (const PlantMode& mode : plant_modes(info, stage.spec.plant)) {
    const double omega = 2.0 * M_PI * mode.natural_frequency_hz;
    Submodel submodel;
    submodel.denominator = {1.0, 2.0 * mode.damping_ratio / omega, 1.0 / (omega * omega)};
    submodel.numerator = {mode.sensor_shape * mode.actuator_shape.transpose() / (omega * omega)};
    if (submodel.numerator[0].squaredNorm() > 0.0) model.submodels.push_back(submodel);
  }
  return model;
}

struct Bench {
  explicit Bench(std::uint64_t seed)
      : stage(draw_judgement_stage(seed)), model(exact_model(stage)) {
    const double spacing_hz = stage.spec.info.sample_rate_hz / stage.period_samples;
    const int first = static_cast<int>(std::ceil(stage.band_low_hz / spacing_hz));
    const int last = static_cast<int>(std::floor(stage.band_high_hz / spacing_hz));
    const int step = std::max(1, (last - first) / 500);
    for (int l = std::max(1, first); l <= last; l += step) lines.push_back(l);
    const FrequencyGrid grid(stage.spec.info.sample_rate_hz, stage.period_samples, lines);
    frequency_hz = grid.frequency_hz();
    excitation.setZero(stage.period_samples, model.n_inputs());
    for (Eigen::Index j = 0; j < excitation.cols(); ++j) {
      MultisineSpec spec;
      spec.level = stage.level_n;
      spec.seed = seed * 100 + static_cast<std::uint64_t>(j);
      excitation.col(j) = random_phase_multisine(grid, spec).samples;
    }
  }
  ExcitedLoop loop(const std::vector<Fault>& faults) const {
    SimulatedSpec spec = stage.spec;
    spec.simulation.faults = faults;
    spec.simulation.seed += 7;
    return {spec, excitation, lines, model.inputs.names, model.outputs.names, stage.seed};
  }
  ModelTracker tracker() const {
    TrackerOptions options;
    options.learning_periods = kLearning;
    options.false_alarms_per_period = kFalseAlarms;
    return {model, frequency_hz, options};
  }

  JudgementStage stage;
  AdditiveModel model;
  std::vector<int> lines;
  Eigen::VectorXd frequency_hz;
  Eigen::MatrixXd excitation;
};

struct Kind {
  const char* name;
  Fault::Kind fault;
  TrackedKind place;
  bool all = false;
  double size = 0.0;  ///< 0: small
};

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {"frequency, small", Fault::Kind::mode_frequency, TrackedKind::frequency},
      {"frequency 2 %", Fault::Kind::mode_frequency, TrackedKind::frequency, false, 0.02},
      {"all frequencies, 0.1 %", Fault::Kind::mode_frequency, TrackedKind::frequency, true, 1e-3},
      {"damping, small", Fault::Kind::mode_damping, TrackedKind::damping},
      {"damping 50 %", Fault::Kind::mode_damping, TrackedKind::damping, false, 0.5},
      {"sensor gain, small", Fault::Kind::sensor_gain, TrackedKind::sensor_gain},
      {"sensor gain 20 %", Fault::Kind::sensor_gain, TrackedKind::sensor_gain, false, 0.2},
      {"all sensor gains, 1 %", Fault::Kind::sensor_gain, TrackedKind::sensor_gain, true, 0.01},
      {"actuator gain, small", Fault::Kind::actuator_gain, TrackedKind::actuator_gain},
      {"actuator dead", Fault::Kind::actuator_gain, TrackedKind::actuator_gain, false, -1.0},
      {"delay of a sample", Fault::Kind::extra_delay, TrackedKind::delay, false, 1.0},
      {"noise x 2", Fault::Kind::sensor_noise, TrackedKind::sensor_gain, false, 1.0}};
  return all;
}

/// What is planted, and its name.
struct Planted {
  Fault fault;
  std::string name;
};

Planted plant(const Bench& bench, const Kind& kind, const ModelTracker& tracker, double deviations,
              RandomNumbers& random) {
  const Eigen::VectorXd deviation =
      tracker.covariance().diagonal().cwiseSqrt() * std::sqrt(kLearning / 4.0);
  // A mode that the data determine: a small change of it is below half of the value.
  std::vector<std::size_t> candidates;
  for (std::size_t p = 0; p < tracker.parameters().size(); ++p) {
    const double small = deviations * deviation[p];
    const bool of_mode = kind.place == TrackedKind::frequency || kind.place == TrackedKind::damping;
    const double most = !of_mode ? 0.3 : kind.place == TrackedKind::frequency ? 0.01 : 0.3;
    if (tracker.parameters()[p].kind == kind.place && small < most) candidates.push_back(p);
  }
  if (candidates.empty()) return {};
  const std::size_t p = candidates[static_cast<std::size_t>(
      random.integer(0, static_cast<int>(candidates.size()) - 1))];
  const TrackedParameter& parameter = tracker.parameters()[p];
  const double sign = random.integer(0, 1) == 0 ? 1.0 : -1.0;
  double size = kind.size;
  if (size == 0.0) size = deviations * deviation[p];
  if (size < 0.3 && kind.fault != Fault::Kind::extra_delay) size *= sign;
  Planted planted;
  planted.fault.kind = kind.fault;
  planted.fault.from_cycle =
      static_cast<std::uint64_t>((1 + kLearning + kBefore) * bench.stage.period_samples);
  const bool factor = kind.fault == Fault::Kind::sensor_gain ||
                      kind.fault == Fault::Kind::actuator_gain ||
                      kind.fault == Fault::Kind::sensor_noise;
  planted.fault.value = factor ? 1.0 + size : size;
  planted.fault.channel = static_cast<int>(parameter.index);
  planted.name = describe(parameter, bench.model);
  if (kind.place == TrackedKind::frequency || kind.place == TrackedKind::damping)
    planted.fault.channel =
        nearest_mode(bench.stage.spec.info, bench.stage.spec.plant,
                     bench.model.submodels[parameter.index].natural_frequency_hz());
  if (kind.place == TrackedKind::delay) planted.fault.channel = 0;
  if (kind.fault == Fault::Kind::sensor_noise)
    planted.name = "noise of sensor '" + bench.model.outputs.name(parameter.index) + "'";
  if (kind.all) {
    planted.fault.channel = -1;
    planted.name = kind.place == TrackedKind::frequency
                       ? "frequencies of all modes"
                       : "gains of all sensors or of all actuators";
  }
  return planted;
}

struct Count {
  int planted = 0, told = 0, right = 0, before = 0, periods = 0;
};

void study(const Bench& bench, const Kind& kind, double deviations, Count& count) {
  RandomNumbers random(bench.stage.seed * 31 + static_cast<std::uint64_t>(kind.name[0]));
  // The deviations come from a stage without change; the stage that changes is the same until then.
  ModelTracker learned = bench.tracker();
  auto quiet = bench.loop({});
  quiet.next();
  for (int t = 0; t < kLearning; ++t) learned.add(quiet.next());
  const Planted planted = plant(bench, kind, learned, deviations, random);
  if (planted.name.empty()) return;
  ModelTracker tracker = bench.tracker();
  auto loop = bench.loop({planted.fault});
  loop.next();
  ++count.planted;
  for (int t = 0; t < kLearning + kBefore + kAfter; ++t) {
    const TrackedPeriod state = tracker.add(loop.next());
    if (!state.change) continue;
    const std::string name = describe(state.change->what, tracker.parameters(), bench.model);
    if (t < kLearning + kBefore) {
      ++count.before;
      continue;
    }
    ++count.told;
    count.periods += t + 1 - kLearning - kBefore;
    if (name == planted.name) {
      ++count.right;
    } else {
      fmt::print(
          "{} seed {} ({} x {}): {} by {:.3g}, told: {} by {:.3g}, p {:.3f}, else {} ({:.2g})\n",
          kind.name, bench.stage.seed, bench.model.n_outputs(), bench.model.n_inputs(),
          planted.name, planted.fault.value, name, state.change->size, state.change->probability,
          describe(*state.change->otherwise, tracker.parameters(), bench.model),
          state.change->other_probability);
    }
    return;
  }
  fmt::print("{} seed {} ({} x {}): {} by {:.3g} not told\n", kind.name, bench.stage.seed,
             bench.model.n_outputs(), bench.model.n_inputs(), planted.name, planted.fault.value);
}

}  // namespace

int main(int argc, char** argv) {
  const int stages = argc > 1 ? std::atoi(argv[1]) : 25;
  const auto first = static_cast<std::uint64_t>(argc > 2 ? std::atoi(argv[2]) : 1);
  const double deviations = argc > 3 ? std::atof(argv[3]) : 8.0;
  const std::string only = argc > 4 ? argv[4] : "all";
  std::map<std::string, Count> counts;
  for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(stages); ++seed) {
    const Bench bench(seed);
    for (const Kind& kind : kinds())
      if (only == "all" || only == kind.name) study(bench, kind, deviations, counts[kind.name]);
  }
  Count all;
  for (const Kind& kind : kinds()) {
    const Count& c = counts[kind.name];
    fmt::print("{:24} planted {:3}, told {:3}, named right {:3}, mean delay {:.1f} periods\n",
               kind.name, c.planted, c.told, c.right,
               c.told > 0 ? static_cast<double>(c.periods) / c.told : 0.0);
    all.planted += c.planted;
    all.told += c.told;
    all.right += c.right;
    all.before += c.before;
  }
  fmt::print("all: planted {}, told {}, named right {} ({:.1f} %); told before the change {}\n",
             all.planted, all.told, all.right, 100.0 * all.right / all.planted, all.before);
}
