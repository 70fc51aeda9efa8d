// Tracks a simulated stage around its model while the stage works, and counts what is found.
//
//   watch_study STAGE.yaml MODEL.json [runs = 20] [periods = 100] [kind = none] [size = 1e-5] [rms of an axis, N = 0.2]
//               [first seed = 1] [false alarms per period = 1e-3] [ramp in periods = 0] [EXPERIMENT.yaml FRF.h5]
//
// kind: none, or a fault of the stage file (mode_frequency, sensor_gain, added_mass ...), planted at a random channel after the
// learning and 8 periods. All actuators of the model are excited at once, on 500 lines, or by the first run of an
// experiment of `stageid design --watch`; with its FRF, the forecast is compared with the scatter over the runs.
// A ramp of a natural frequency grows from zero to `size`. Its lag is what the estimate is behind the change at the
// middle of the newest period, divided by the change per period.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "estimation/tracking/model_tracker.hpp"
#include "excitation/multisine/multisine.hpp"
#include "frf/file/frf_file.hpp"
#include "hal/simulator/plant_spec.hpp"
#include "tests/benchmark/arguments.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/stages/excited_loop.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/watch_plan.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

struct Request {
  Arguments argument;
  int runs = argument(3, 20);
  int periods = argument(4, 100);
  std::string kind = argument.word(5, "none");
  double size = argument(6, 1e-5);
  double rms = argument(7, 0.2);
  std::uint64_t seed = argument(8, std::uint64_t{1});
  double alarms = argument(9, 1e-3);
  double ramp = argument(10, 0.0);
};

/// Periodic excitation of the stage's actuators.
struct Excitation {
  std::vector<int> lines;
  int period_samples = 0;
  std::vector<std::string> axes;
  Eigen::MatrixXd samples;  ///< of one period, by axis
};

Excitation flat_excitation(const StageConfig& config, const AdditiveModel& model, double rms,
                           std::uint64_t seed) {
  Excitation out;
  out.period_samples = static_cast<int>(config.spec.info.sample_rate_hz);
  for (int l = 21; l < 2000 && l < out.period_samples / 2; l += 4) out.lines.push_back(l);
  out.axes = model.inputs.names;
  const FrequencyGrid grid(config.spec.info.sample_rate_hz, out.period_samples, out.lines);
  out.samples.resize(out.period_samples, std::ssize(out.axes));
  for (std::size_t j = 0; j < out.axes.size(); ++j) {
    MultisineSpec spec;
    spec.level = rms;
    spec.seed = 1000 * seed + j;
    out.samples.col(j) = random_phase_multisine(grid, spec).samples;
  }
  return out;
}

Excitation designed_excitation(const ExperimentConfig& experiment) {
  const ExperimentPlan plan = make_plan(experiment);
  Excitation out{
      plan.grid().lines(), plan.grid().samples_per_period(), {}, plan.excitation({0, 0})};
  for (const ExcitationAxis& axis : experiment.experiment.axes) out.axes.push_back(axis.channel);
  return out;
}

ExcitedLoop make_loop(const StageConfig& config, const SimulationSpec& simulation,
                      const AdditiveModel& model, const Excitation& excitation,
                      std::uint64_t seed) {
  const std::vector<Channel>& actuators = config.spec.info.actuators;
  Eigen::MatrixXd samples = Eigen::MatrixXd::Zero(excitation.period_samples, std::ssize(actuators));
  for (std::size_t j = 0; j < excitation.axes.size(); ++j)
    samples.col(channel_index(actuators, excitation.axes[j])) = excitation.samples.col(j);
  const SimulatedSpec spec{config.spec, *config.plant, simulation};
  return {spec, std::move(samples), excitation.lines, model.inputs.names, model.outputs.names,
          seed};
}

/// A motion that never repeats: moves to random places within +- stroke, with rests between them. Position, velocity and
/// acceleration are continuous.
class PointToPoint {
 public:
  PointToPoint(double stroke_m, double sample_rate_hz, std::uint64_t seed)
      : stroke_m_(stroke_m), sample_rate_hz_(sample_rate_hz), random_(seed) {}

  /// The position at the next sample, m.
  double next() {
    if (++sample_ > moving_ + resting_) plan();
    const double t = sample_ < moving_ ? static_cast<double>(sample_) / moving_ : 1.0;
    return from_m_ + (to_m_ - from_m_) * t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
  }

 private:
  void plan() {
    from_m_ = to_m_;
    to_m_ = random_.uniform(-stroke_m_, stroke_m_);
    moving_ = static_cast<int>(random_.uniform(0.2, 0.5) * sample_rate_hz_);
    resting_ = static_cast<int>(random_.uniform(0.0, 0.3) * sample_rate_hz_);
    sample_ = 0;
  }

  double stroke_m_;
  double sample_rate_hz_;
  RandomNumbers random_;
  double from_m_ = 0.0;
  double to_m_ = 0.0;
  int moving_ = 0;
  int resting_ = 0;
  int sample_ = 0;
};

/// A change of the stage, and its name by the tracker.
struct Planted {
  std::string name;
  int period = 0;
  double value = 0.0;
};

/// How far the estimates are behind ramps, in periods.
struct RampLag {
  RampLag(const Request& request, double memory_periods)
      : ramp_(request.ramp), memory_(memory_periods) {}

  /// @param change of the estimate since the learning   @param periods since the ramp began, at the middle of the last
  void add(double change, double deviation, double value, double periods) {
    if (periods > ramp_) return;
    const double slope = value / ramp_;
    const double lag = periods - change / slope;
    lags_.push_back(lag);
    deviation_ = std::max(deviation_, deviation / std::abs(slope));
    within_ += lag <= memory_ + 2.0 * deviation / std::abs(slope) ? 1 : 0;
    const auto block = static_cast<std::size_t>(periods) / kBlock;
    if (block >= sums_.size()) sums_.resize(block + 1);
    sums_[block].first += lag;
    sums_[block].second += 1.0;
  }
  void print() {
    if (lags_.empty()) return;
    for (std::size_t i = 0; i < sums_.size(); ++i)
      fmt::print("  periods {:4} to {:4} of the ramp: mean lag {:.1f} periods\n", i * kBlock,
                 (i + 1) * kBlock, sums_[i].first / sums_[i].second);
    std::sort(lags_.begin(), lags_.end());
    const auto part = [&](double share) {
      return lags_[static_cast<std::size_t>(share * static_cast<double>(lags_.size() - 1))];
    };
    fmt::print(
        "lag median {:.1f}, 95 % {:.1f}, largest {:.1f} periods; largest deviation {:.1f} periods; "
        "within the memory of {:.0f} and two deviations {:.1f} %\n",
        part(0.5), part(0.95), part(1.0), deviation_, memory_,
        100.0 * within_ / static_cast<double>(lags_.size()));
  }

 private:
  static constexpr std::size_t kBlock = 50;
  double ramp_;
  double memory_;
  std::vector<double> lags_;
  std::vector<std::pair<double, double>> sums_;  // of lags, and their number, by block
  double deviation_ = 0.0;
  int within_ = 0;
};

Planted plant_change(const Request& request, int learning, int period_samples,
                     const StageConfig& config, const AdditiveModel& model, std::uint64_t seed,
                     SimulationSpec& simulation) {
  using Fault = SimulationSpec::Fault;
  Planted planted;
  planted.period = learning + 8;
  Fault fault;
  bool all = false;
  std::string kind = request.kind;
  if (kind.starts_with("all_")) {
    all = true;
    kind = kind.substr(4);
  }
  fault.kind = *from_word<Fault::Kind>(kind);
  const auto period = static_cast<std::uint64_t>(period_samples);
  fault.from_cycle = static_cast<std::uint64_t>(planted.period + 1) * period;
  fault.ramp_s = request.ramp;
  RandomNumbers random(seed);
  // A factor for gains and noise, a relative change for modes.
  const bool factor = kind == "sensor_gain" || kind == "actuator_gain" || kind == "sensor_noise";
  const double sign = random.integer(0, 1) == 1 ? 1.0 : -1.0;
  fault.value = factor                  ? 1.0 + sign * request.size
                : kind == "extra_delay" ? request.size
                                        : sign * request.size;
  if (kind == "sensor_noise") fault.value = 1.0 + request.size;
  const auto parameters = tracked_parameters(model, {20.0, 2000.0});
  const auto pick = [&](TrackedKind wanted) {
    std::vector<TrackedParameter> of_kind;
    for (const auto& p : parameters)
      if (p.kind == wanted) of_kind.push_back(p);
    return of_kind[static_cast<std::size_t>(
        random.integer(0, static_cast<int>(of_kind.size()) - 1))];
  };
  fault.channel = -1;
  if (kind == "mode_frequency" || kind == "mode_damping") {
    planted.name = "frequencies of all modes";
    if (!all) {
      const auto p = pick(kind == "mode_frequency" ? TrackedKind::frequency : TrackedKind::damping);
      planted.name = describe(p, model);
      fault.channel = nearest_mode(config.spec.info, *config.plant,
                                   model.submodels[p.index].natural_frequency_hz());
    }
  } else if (kind == "sensor_gain" || kind == "sensor_noise") {
    planted.name = "gains of all sensors or of all actuators";
    if (!all) {
      const auto p = pick(TrackedKind::sensor_gain);
      const std::string& name = model.outputs.name(p.index);
      planted.name =
          (kind == "sensor_gain" ? "gain of sensor '" : "noise of sensor '") + name + "'";
      fault.channel = channel_index(config.spec.info.sensors, name);
    }
  } else if (kind == "actuator_gain") {
    const auto p = pick(TrackedKind::actuator_gain);
    const std::string& name = model.inputs.name(p.index);
    planted.name = "gain of actuator '" + name + "'";
    fault.channel = channel_index(config.spec.info.actuators, name);
  } else if (kind == "added_mass") {
    // The tracker has no such name; the study prints what it is called instead.
    fault.channel =
        channel_index(config.spec.info.actuators,
                      model.inputs.name(random.integer(0, static_cast<int>(model.n_inputs()) - 1)));
    fault.value = request.size;
    planted.name = "mass at actuator '" + config.spec.info.actuators[fault.channel].name + "'";
  } else {
    planted.name = "delay";
    fault.channel = 0;
  }
  planted.value = fault.value;
  simulation.faults.push_back(fault);
  return planted;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const Request request{{argc, argv}};
  const StageConfig config = load_stage_config(argv[1]);
  const AdditiveModel model = read_model(argv[2]);
  std::optional<Excitation> designed;
  std::optional<WatchForecast> forecast;
  if (argc > 11) {
    const ExperimentConfig experiment = load_experiment_config(argv[11]);
    designed = designed_excitation(experiment);
    if (argc > 12) forecast = forecast_of(experiment, model, read_frf(argv[12]), 1e-5);
  }
  const auto excitation_of = [&](std::uint64_t seed) {
    return designed ? *designed : flat_excitation(config, model, request.rms, seed);
  };
  const Excitation first = excitation_of(request.seed);
  const Eigen::VectorXd frequency_hz =
      FrequencyGrid(config.spec.info.sample_rate_hz, first.period_samples, first.lines)
          .frequency_hz();
  Eigen::ArrayXXd estimates;

  int alarms = 0, watched = 0, detected = 0, named = 0;
  std::vector<int> delays;
  Eigen::ArrayXd sum, square, inside;
  double counted = 0.0;
  RampLag lag(request, TrackerOptions{}.memory_periods);
  int later_alarms = 0, later_right = 0;
  double tracking_s = 0.0, simulated_s = 0.0, slowest_s = 0.0;
  for (int run = 0; run < request.runs; ++run) {
    const std::uint64_t seed = request.seed + static_cast<std::uint64_t>(run);
    TrackerOptions options;
    options.false_alarms_per_period = request.alarms;
    SimulationSpec simulation = config.simulation;
    simulation.seed = seed;
    Planted planted;
    const bool moves = request.kind.ends_with("motion");
    if (request.kind != "none" && !moves)
      planted = plant_change(request, options.learning_periods, first.period_samples, config, model,
                             seed, simulation);
    auto loop = make_loop(config, simulation, model, excitation_of(seed), seed);
    ModelTracker tracker(model, frequency_hz, options);
    bool seen = false;
    Eigen::Index ramped = -1;
    if (request.ramp > 0.0 && request.kind == "mode_frequency")
      for (std::size_t i = 0; i < tracker.parameters().size(); ++i)
        if (describe(tracker.parameters()[i], model) == planted.name)
          ramped = static_cast<Eigen::Index>(i);
    Eigen::VectorXd learned_estimate;
    const int n_y = static_cast<int>(config.spec.info.sensors.size());
    const double rate_hz = config.spec.info.sample_rate_hz;
    if (moves)
      loop.follow([=, motion = PointToPoint(request.size, rate_hz, seed),
                   still_s = request.kind == "later_motion" ? 60.0 : 0.0](std::uint64_t n) mutable {
        const double z = static_cast<double>(n) < still_s * rate_hz ? 0.0 : motion.next();
        return Eigen::VectorXd::Constant(n_y, z);
      });
    loop.next();
    const auto began = std::chrono::steady_clock::now();
    for (int p = 0; p < request.periods; ++p) {
      const PeriodSpectra period = loop.next();
      const auto start = std::chrono::steady_clock::now();
      const TrackedPeriod state = tracker.add(period);
      const double spent_s =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      tracking_s += spent_s;
      slowest_s = std::max(slowest_s, spent_s);
      if (!state.learning) ++watched;
      if (p + 1 == options.learning_periods) learned_estimate = tracker.estimate();
      if (ramped >= 0 && p >= planted.period)
        lag.add(tracker.estimate()[ramped] - learned_estimate[ramped],
                std::sqrt(tracker.covariance()(ramped, ramped)), planted.value,
                p - planted.period + 0.5);
      if (state.change) {
        ++alarms;
        if (!planted.name.empty() && p >= planted.period) {
          ++later_alarms;
          if (describe(state.change->what, tracker.parameters(), model) == planted.name)
            ++later_right;
        }
        if (!planted.name.empty() && p >= planted.period && !seen) {
          seen = true;
          ++detected;
          delays.push_back(p - planted.period + 1);
          const bool right =
              describe(state.change->what, tracker.parameters(), model) == planted.name;
          named += right ? 1 : 0;
          fmt::print("{} {} after {} periods; planted: {}\n  ", right ? "right" : "WRONG", seed,
                     p - planted.period + 1, planted.name);
        }
        fmt::print(
            "seed {} period {}: {} {:.3g} +- {:.2g} p {:.3f} since {} statistic {:.1f} (limit "
            "{:.1f})\n",
            seed, p, describe(state.change->what, tracker.parameters(), model), state.change->size,
            state.change->deviation, state.change->probability, state.change->periods,
            state.change->statistic, state.threshold);
      }
    }
    simulated_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    if (run == 0) {
      fmt::print("chi-square of the reference {:.3f}, relative error {:.2e}\n",
                 fmt::join(tracker.reference().chi_square, " "),
                 fmt::join(tracker.reference().relative_error, " "));
      const Eigen::VectorXd deviation = tracker.covariance().diagonal().cwiseSqrt();
      for (Eigen::Index i = 0; i < deviation.size(); ++i)
        fmt::print("  {}: {:.3e} +- {:.3e}\n", describe(tracker.parameters()[i], model),
                   tracker.estimate()[i], deviation[i]);
      sum.setZero(deviation.size());
      square.setZero(deviation.size());
      inside.setZero(deviation.size());
      estimates.resize(deviation.size(), request.runs);
    }
    estimates.col(run) = tracker.estimate() - learned_estimate;
    const Eigen::ArrayXd ratio =
        tracker.estimate().array() / tracker.covariance().diagonal().array().sqrt();
    sum += ratio;
    square += ratio.square();
    inside += (ratio.abs() < 1.96).cast<double>();
    counted += 1.0;
  }
  fmt::print(
      "{} alarms in {} watched periods; tracking {:.2f} ms a period, at most {:.0f}, simulation "
      "{:.2f} ms\n",
      alarms, watched, 1e3 * tracking_s / (counted * request.periods), 1e3 * slowest_s,
      1e3 * (simulated_s - tracking_s) / (counted * request.periods));
  if (request.kind != "none" && !request.kind.ends_with("motion")) {
    std::sort(delays.begin(), delays.end());
    fmt::print("{} of {} detected, {} named right; delay median {}, 95 % {} periods\n", detected,
               request.runs, named, delays.empty() ? 0 : delays[delays.size() / 2],
               delays.empty() ? 0 : delays[delays.size() * 95 / 100]);
    fmt::print("{} alarms after the change began, {} of them with its name\n", later_alarms,
               later_right);
    lag.print();
    return 0;
  }
  if (forecast) {
    // From the mean of the learned periods to that of all, with weights lambda^n: the error of the model, which depends
    // on the learned weights of the lines, is part of both.
    const double lambda = std::exp(-1.0 / TrackerOptions{}.memory_periods);
    const int learned = TrackerOptions{}.learning_periods;
    double later = 0.0, squares = 0.0;
    for (int n = 0; n < request.periods - learned; ++n) {
      later += std::pow(lambda, n);
      squares += std::pow(lambda, 2 * n);
    }
    const double all = later + learned * std::pow(lambda, request.periods - learned);
    const double share = std::sqrt(squares + later * later / learned) / all;
    for (Eigen::Index i = 0; i < estimates.rows(); ++i) {
      const Eigen::ArrayXd x = estimates.row(i);
      const double seen = std::sqrt((x - x.mean()).square().sum() / (counted - 1.0));
      const double expected = share * forecast->deviation[i];
      fmt::print("forecast {:.2e} seen {:.2e} ratio {:.2f} {:.1f} periods\n", expected, seen,
                 seen / expected, forecast->periods[i]);
    }
  }
  const Eigen::ArrayXd mean = sum / counted;
  const Eigen::ArrayXd scatter =
      ((square / counted - mean.square()) * counted / (counted - 1.0)).sqrt();
  fmt::print(
      "mean / deviation {:.2f}\nscatter / deviation {:.2f}\ncoverage {:.3f}\nall: {:.3f} {:.3f}\n",
      fmt::join(mean, " "), fmt::join(scatter, " "), fmt::join(inside / counted, " "),
      std::sqrt(scatter.square().mean()), inside.mean() / counted);
}
