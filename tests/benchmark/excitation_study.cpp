// What a design is worth, on a simulated stage: orthogonal against single-axis multisines at equal rms and
// time, multisines within limits against flat random-phase ones at equal limits, and whether the limits
// hold in simulated runs.
//
//   excitation_study STAGE.yaml [runs = 1000] [period_s = 4] [high_hz = 2000] [axes = 13]
//                    [realizations = 3] [crest iterations = 40] [pilot rms/N = 0.5] [rms/N = 1]
//
// The first actuators and all sensors in the direction of the first actuator are used. The prior of
// the design is the FRF of a simulated pilot: its noise and its errors are in it.

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <memory>

#include "acquisition/measurement_loop.hpp"
#include "acquisition/run_experiment.hpp"
#include "frf/frf_file.hpp"
#include "frf/plant_frf.hpp"
#include "frf/relative_variance.hpp"
#include "hal/simulated_stage.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/limited_excitation.hpp"
#include "tools/stage_config.hpp"

namespace stageid {
namespace {

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Study {
  WaferStageSpec stage;
  int runs = 1000;
  double period_s = 4.0;
  double high_hz = 2000.0;
  int axes = 13;
  int realizations = 3;
  int iterations = 40;
  double pilot_rms_n = 0.5;
  double rms_n = 1.0;
  std::vector<std::string> outputs;

  FrequencyGrid grid(double seconds) const {
    const double rate_hz = stage.info.sample_rate_hz;
    return FrequencyGrid::band(rate_hz, static_cast<int>(std::lround(seconds * rate_hz)),
                               {.low_hz = 1.0 / seconds, .high_hz = high_hz});
  }
  ExperimentSpec spec(ExcitationScheme scheme, double rms, std::uint64_t seed) const {
    ExperimentSpec spec;
    spec.scheme = scheme;
    for (int p = 0; p < axes; ++p)
      spec.axes.push_back({stage.info.actuators[static_cast<std::size_t>(p)].name, rms, {}});
    spec.realizations = 1;
    spec.periods = 2;
    spec.transient_periods = 1;
    spec.seed = seed;
    return spec;
  }
};

FrfEstimate measure(const Study& study, const ExperimentPlan& plan, const FrfOptions& options) {
  LimitedStage stage(std::make_unique<SimulatedStage>(study.stage), study.stage.limits);
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

/// The mean over lines, outputs and inputs of the ratio of both variances.
void compare_schemes(const Study& study) {
  FrfOptions options;
  options.outputs = study.outputs;
  const FrequencyGrid grid = study.grid(study.period_s);
  const auto frf = [&](ExcitationScheme scheme) {
    return measure(study, ExperimentPlan(grid, study.spec(scheme, study.rms_n, 11)), options);
  };
  const FrfEstimate single = frf(ExcitationScheme::single_axis);
  const FrfEstimate orthogonal = frf(ExcitationScheme::orthogonal_dft);
  for (double low = grid.resolution_hz(); low < study.high_hz; low *= 4.0) {
    const double high = std::min(4.0 * low, study.high_hz);
    const FrfEstimate a = select_band(single, low, high);
    fmt::print("  {:8.2f} ... {:8.2f} Hz: {:.3f}; {:.2e}\n", low, high,
               mean_relative_variance(a, VarianceKind::noise) /
                   mean_relative_variance(select_band(orthogonal, low, high), VarianceKind::noise),
               mean_relative_variance(a, VarianceKind::noise));
  }
  // Both means carry few degrees of freedom a line; over the lines they are as good as exact.
  fmt::print("orthogonal: {:.3f} times less variance than single axis, {} axes at {} N rms\n",
             mean_relative_variance(single, VarianceKind::noise) /
                 mean_relative_variance(orthogonal, VarianceKind::noise),
             study.axes, study.rms_n);
}

/// Amplitudes of flat random-phase multisines that use `safety` of the tightest limit.
double flat_variance(const Study& study, const BoundedLoop& loop, double safety) {
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
  return relative_variance(plan, loop.cost) / (scale * scale);
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
  LimitedStage stage(std::make_unique<SimulatedStage>(study.stage), study.stage.limits);
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

void design_within(const Study& study) {
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
  const BoundedLoop loop = bounded_loop(
      grid, spec.experiment, study.stage,
      read_plant_prior(directory / "pilot.h5", study.stage.info, grid.frequency_hz()), {}, {});
  spec.cost = loop.cost;
  spec.signals = loop.signals;
  const auto start = Clock::now();
  const LimitedDesign design = design_within_limits(grid, spec);
  fmt::print("pilot of {:.0f} s; design of {} runs in {:.1f} s\n", pilot_plan.duration_s(),
             design.plan.runs().size(), since(start));
  print_use(loop, design);
  const double flat = flat_variance(study, loop, spec.safety);
  const double designed = relative_variance(design.plan, loop.cost);
  fmt::print("within limits: {:.3e} against {:.3e} of flat random phases, {:.2f} times less\n",
             designed, flat, flat / designed);
  const auto begin = Clock::now();
  const int hit = violations(study, design.plan, study.runs);
  fmt::print("{} of {} simulated runs hit a limit, in {:.0f} s\n", hit, study.runs, since(begin));
}

}  // namespace
}  // namespace stageid

int main(int argc, char** argv) {
  using namespace stageid;
  if (argc < 2) {
    fmt::print(stderr, "excitation_study STAGE.yaml [runs ...]; see the head of its source\n");
    return 2;
  }
  const auto number = [&](int i, double otherwise) {
    return i < argc ? std::atof(argv[i]) : otherwise;
  };
  Study study;
  study.stage = load_stage_config(argv[1]).spec;
  study.runs = static_cast<int>(number(2, study.runs));
  study.period_s = number(3, study.period_s);
  study.high_hz = number(4, study.high_hz);
  study.axes = static_cast<int>(number(5, study.axes));
  study.realizations = static_cast<int>(number(6, study.realizations));
  study.iterations = static_cast<int>(number(7, study.iterations));
  study.pilot_rms_n = number(8, study.pilot_rms_n);
  study.rms_n = number(9, study.rms_n);
  const auto& direction = study.stage.info.actuators.front().direction;
  for (const Channel& channel : study.stage.info.sensors)
    if (std::equal(std::begin(direction), std::end(direction), std::begin(channel.direction)))
      study.outputs.push_back(channel.name);
  compare_schemes(study);
  design_within(study);
  return 0;
}
