// Benefit of a design, on a simulated stage: orthogonal against single-axis multisines at equal rms and time,
// multisines within limits against flat random-phase ones at equal limits, and whether the limits hold in simulated
// runs.
//
//   excitation_study STAGE.yaml [runs = 1000] [period_s = 4] [high_hz = 2000] [axes = 13]
//                    [realizations = 3] [crest iterations = 40] [pilot rms/N = 0.5] [rms/N = 1]
//
// The first actuators and all sensors in the direction of the first actuator are used. The prior of
// the design is the FRF of a simulated pilot: its noise and its errors are in it. Exit code 1 unless the
// gain by orthogonality is the number of axes within 5 %, that by design 2 or more, and no limit was hit.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "acquisition/formats/open_log.hpp"
#include "acquisition/loop/measurement_loop.hpp"
#include "acquisition/loop/run_experiment.hpp"
#include "acquisition/prediction/limited_excitation.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/plant/plant_frf.hpp"
#include "frf/response/confidence.hpp"
#include "tests/benchmark/arguments.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/simulated_spec.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/experiment/plant_prior_file.hpp"

namespace stageid {
namespace {

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Study {
  test::Arguments argument;
  test::SimulatedSpec stage;
  int runs = argument(2, 1000);
  double period_s = argument(3, 4.0);
  double high_hz = argument(4, 2000.0);
  int axes = argument(5, 13);
  int realizations = argument(6, 3);
  int iterations = argument(7, 40);
  double pilot_rms_n = argument(8, 0.5);
  double rms_n = argument(9, 1.0);
  std::vector<std::string> outputs{};

  FrequencyGrid grid(double seconds) const {
    const double rate_hz = stage.info.sample_rate_hz;
    return FrequencyGrid::band(rate_hz, static_cast<int>(std::lround(seconds * rate_hz)),
                               {.low_hz = 1.0 / seconds, .high_hz = high_hz});
  }
  ExperimentSpec spec(ExcitationScheme scheme, double rms, std::uint64_t seed) const {
    ExperimentSpec spec;
    spec.scheme = scheme;
    for (int p = 0; p < axes; ++p) spec.axes.push_back({stage.info.actuators[p].name, rms, {}});
    spec.realizations = 1;
    spec.periods = 2;
    spec.transient_periods = 1;
    spec.seed = seed;
    return spec;
  }
};

FrfEstimate measure(const Study& study, const ExperimentPlan& plan, const FrfOptions& options) {
  LimitedStage stage(test::simulated(study.stage), study.stage.limits);
  MotionController controller(study.stage.controller);
  const test::TemporaryDirectory directory;
  SlogWriter log =
      SlogWriter::create(directory / "run.slog", experiment_log_info(plan, stage.info()));
  const ExperimentResult result = run_experiment(plan, stage, controller, log);
  log.close(0, "");
  if (result.end != ExperimentEnd::complete) throw std::runtime_error(result.message);
  const auto reader = open_log(directory / "run.slog");
  return estimate_plant_frf({reader.get()}, options);
}

// Below, the loop holds the stage and the response is not identified from this experiment.
constexpr double kLowest_hz = 20.0;

/// How many times less variance orthogonal multisines leave, over all lines from kLowest_hz on.
double gain_of_orthogonality(const Study& study) {
  FrfOptions options;
  options.outputs = study.outputs;
  const FrequencyGrid grid = study.grid(study.period_s);
  const auto frf = [&](ExcitationScheme scheme) {
    return measure(study, ExperimentPlan(grid, study.spec(scheme, study.rms_n, 11)), options);
  };
  const FrfEstimate single = frf(ExcitationScheme::single_axis);
  const FrfEstimate orthogonal = frf(ExcitationScheme::orthogonal_dft);
  const auto gain = [&](double low_hz, double high_hz) {
    const auto variance = [&](const FrfEstimate& whole) {
      return mean_relative_variance(select_band(whole, low_hz, high_hz), VarianceKind::noise);
    };
    return variance(single) / variance(orthogonal);
  };
  for (double low_hz = grid.resolution_hz(); low_hz < study.high_hz; low_hz *= 4.0)
    fmt::print("  {:8.2f} ... {:8.2f} Hz: {:.3f}\n", low_hz, std::min(4.0 * low_hz, study.high_hz),
               gain(low_hz, std::min(4.0 * low_hz, study.high_hz)));
  const double whole = gain(kLowest_hz, study.high_hz);
  fmt::print(
      "orthogonal: {:.3f} times less variance than single axis from {} Hz on, {} axes at {} N "
      "rms\n",
      whole, kLowest_hz, study.axes, study.rms_n);
  return whole;
}

/// The part of a cost on lines from `low_hz`.
Eigen::MatrixXd cost_above(const FrequencyGrid& grid, Eigen::MatrixXd cost, double low_hz) {
  for (Eigen::Index k = 0; k < grid.size(); ++k)
    if (grid.frequency_hz()[k] < low_hz) cost.col(k).setZero();
  return cost;
}

/// Flat random-phase multisines that use `safety` of the tightest limit.
ExperimentPlan flat_plan(const Study& study, const BoundedLoop& loop, double safety) {
  ExperimentSpec spec = study.spec(ExcitationScheme::orthogonal_dft, 1.0, 5);
  spec.realizations = study.realizations;
  const FrequencyGrid grid = study.grid(study.period_s);
  const ExperimentPlan plan(grid, spec);
  std::vector<SignalPeak> peaks(loop.signals.size());
  SignalPredictor predictor(grid);
  for (const RunId run : plan.runs()) {
    const std::vector<SignalPeak> one = predictor.predict(loop.signals, plan.spectrum(run));
    for (std::size_t s = 0; s < one.size(); ++s) peaks[s].include(one[s]);
  }
  double scale = std::numeric_limits<double>::infinity();
  for (std::size_t s = 0; s < peaks.size(); ++s) {
    const BoundedSignal& b = loop.signals[s];
    scale = std::min({scale, (safety * b.peak_limit - b.reserve) / peaks[s].peak(),
                      safety * b.rms_limit / peaks[s].rms});
  }
  fmt::print("flat random phases: {:.3g} N rms\n", scale);
  for (ExcitationAxis& axis : spec.axes) axis.level = scale;
  return {grid, spec};
}

void print_use(const BoundedLoop& loop, const LimitedDesign& design) {
  constexpr const char* kKinds[] = {"", " change", " velocity"};
  for (std::size_t s = 0; s < loop.signals.size(); ++s) {
    const BoundedSignal& b = loop.signals[s];
    const SignalPeak& p = design.peaks[s];
    fmt::print(
        "  {:4}{:9} peak {:.4g} (from rest {:.4g}) + {:.2g} of {:.4g}, rms {:.4g} of {:.4g}: "
        "{:.3f}\n",
        b.name, kKinds[static_cast<int>(b.kind)], p.steady, p.from_rest, b.reserve, b.peak_limit,
        p.rms, b.rms_limit, limit_use(b, p));
  }
}

/// Runs that end at a limit, of so many with noise of their own.
int violations(const Study& study, const ExperimentPlan& plan, int runs) {
  LimitedStage stage(test::simulated(study.stage), study.stage.limits);
  MotionController controller(study.stage.controller);
  SampleRing ring(study.stage.info.actuators.size() + study.stage.info.sensors.size() + 1, 4096);
  MeasurementLoop loop(stage, controller, ring);
  const std::vector<RunId> all = plan.runs();
  int hit = 0;
  for (int i = 0; i < runs; ++i) {
    LoopExcitation excitation;
    excitation.period = plan.excitation(all[static_cast<std::size_t>(i) % all.size()]);
    for (int p = 0; p < study.axes; ++p) excitation.actuators.push_back(p);
    excitation.samples = static_cast<std::uint64_t>(2 * plan.grid().samples_per_period());
    loop.start(static_cast<std::uint64_t>(i) + 1, excitation);
    LoopStatus status = LoopStatus::running;
    while (status != LoopStatus::ended) {
      status = loop.step();
      if (status == LoopStatus::ring_full) ring.pop(ring.front(4096).size() / ring.row_words());
    }
    if (loop.reason() == StopReason::none) continue;
    if (hit++ == 0) fmt::print("run {}: {}\n", i, describe(stage.violation(), stage.info()));
  }
  return hit;
}

/// Whether the design is worth a factor of two and keeps all limits.
bool design_within(const Study& study) {
  const test::TemporaryDirectory directory;
  FrfOptions options;
  options.method = FrfMethod::lpm;
  options.outputs = study.outputs;
  ExperimentSpec pilot = study.spec(ExcitationScheme::orthogonal_dft, study.pilot_rms_n, 3);
  pilot.transient_periods = 0;
  const ExperimentPlan pilot_plan(study.grid(study.period_s / 2.0), pilot);
  write_frf(directory / "pilot.h5", measure(study, pilot_plan, options));

  const FrequencyGrid grid = study.grid(study.period_s);
  LimitedDesignSpec spec;
  spec.experiment = study.spec(ExcitationScheme::orthogonal_dft, 1.0, 5);
  spec.experiment.realizations = study.realizations;
  spec.experiment.crest_iterations = study.iterations;
  const BoundedLoop loop = bounded_loop(grid, spec.experiment, study.stage,
                                        read_plant_prior(directory / "pilot.h5", study.stage.info,
                                                         grid.frequency_hz(), below_band_hz(grid)),
                                        {}, {});
  spec.cost = loop.cost;
  spec.signals = loop.signals;
  const auto start = Clock::now();
  const LimitedDesign design = design_within_limits(grid, spec);
  fmt::print("pilot of {:.0f} s; design of {} runs in {:.1f} s\n", pilot_plan.duration_s(),
             design.plan.runs().size(), since(start));
  print_use(loop, design);
  const ExperimentPlan flat = flat_plan(study, loop, spec.safety);
  double least_gain = std::numeric_limits<double>::infinity();
  for (const double low_hz : {0.0, kLowest_hz}) {
    const Eigen::MatrixXd cost = cost_above(grid, loop.cost, low_hz);
    const double gain = relative_variance(flat, cost) / relative_variance(design.plan, cost);
    fmt::print(
        "within limits: {:.2f} times less variance than flat random phases, lines from {} Hz on\n",
        gain, low_hz);
    least_gain = std::min(least_gain, gain);
  }
  const auto begin = Clock::now();
  const int hit = violations(study, design.plan, study.runs);
  fmt::print("{} of {} simulated runs hit a limit, in {:.0f} s\n", hit, study.runs, since(begin));
  return hit == 0 && least_gain >= 2.0;
}

}  // namespace
}  // namespace stageid

int main(int argc, char** argv) {
  using namespace stageid;
  if (argc < 2) {
    fmt::print(stderr, "excitation_study STAGE.yaml [runs ...]; see the head of its source\n");
    return 2;
  }
  const StageConfig config = load_stage_config(argv[1]);
  Study study{.argument = {argc, argv},
              .stage = {config.spec, config.plant.value(), config.simulation, config.pace}};
  const auto& direction = study.stage.info.actuators.front().direction;
  for (const Channel& channel : study.stage.info.sensors)
    if (std::equal(std::begin(direction), std::end(direction), std::begin(channel.direction)))
      study.outputs.push_back(channel.name);
  const bool orthogonal = std::abs(gain_of_orthogonality(study) / study.axes - 1.0) <= 0.05;
  const bool within = design_within(study);
  if (!orthogonal || !within) fmt::print("the figures are not reached\n");
  return orthogonal && within ? 0 : 1;
}
