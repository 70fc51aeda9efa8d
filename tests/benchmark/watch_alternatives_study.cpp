// Detection of a step of one natural frequency: the tracker, fits from scratch, and a recursive estimate of one response.
//
//   watch_alternatives_study WATCH.yaml MODEL.json [runs = 100] [quiet runs = 200] [first seed = 1] [DESIGNED.yaml, or -]
//                            [method = all]
//
// WATCH.yaml: an experiment with the scheme `simultaneous`. Every method has its lines, levels and periods.
//   watch       all axes at once; also with the excitation of DESIGNED.yaml
//   refit N     all axes at once in orthogonal experiments of 1 transient and some measured periods, N periods in all;
//               then frf, and fit from the model
//   siso M      the one axis, to the one sensor, that shows every mode; recursive least squares with memory M for the
//               frequency of each mode from the lines within two half-power bandwidths
// All but watch are given their exact means and deviations, from the quiet runs. Their thresholds are those with one
// alarm per 1000 periods in these runs, which is what watch is asked for.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/tracking/model_tracker.hpp"
#include "estimation/tracking/tracked_response.hpp"
#include "frf/response/line_estimate.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/stages/excited_loop.hpp"
#include "tools/experiment/config_plan.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

constexpr int kLearning = 32;
constexpr int kQuiet = 400;  // watched periods of a quiet run, and of one with a step after it
constexpr int kAfter = 200;
constexpr double kFalseAlarms = 1e-3;  // per period

/// A stage without or with a step.
struct Case {
  std::uint64_t seed = 0;
  int mode = 0;       ///< of the tracked frequencies
  double step = 0.0;  ///< relative; 0: none
  int period = 0;     ///< of the step
  int periods = kLearning + kQuiet;
};

/// By period: what a method compares with a threshold, one value per hypothesis; empty if there is nothing new.
using Trace = std::vector<Eigen::VectorXd>;

class Bench {
 public:
  Bench(const ExperimentConfig& config, AdditiveModel model)
      : config_(config), model_(std::move(model)) {
    frequency_hz_ = make_plan(config).grid().frequency_hz();
    for (const auto& p :
         tracked_parameters(model_, {frequency_hz_[0], frequency_hz_[frequency_hz_.size() - 1]}))
      if (p.kind == TrackedKind::frequency) modes_.push_back(p);
    choose_channels();
  }

  int modes() const { return static_cast<int>(modes_.size()); }
  std::string siso_name() const {
    return model_.inputs.name(input_) + " to " + model_.outputs.name(output_);
  }

  /// One if the tracker has named a change.
  Trace watch(const ExperimentConfig& config, const Case& of) const {
    const ExperimentPlan plan = make_plan(config);
    TrackerOptions options;
    options.learning_periods = kLearning;
    options.false_alarms_per_period = kFalseAlarms;
    ModelTracker tracker(model_, plan.grid().frequency_hz(), options);
    auto loop = make_loop(plan, of);
    loop.next();
    Trace trace;
    for (int p = 0; p < of.periods; ++p) {
      const TrackedPeriod state = tracker.add(loop.next());
      trace.push_back(Eigen::VectorXd::Constant(1, state.change ? 1.0 : 0.0));
    }
    return trace;
  }

  /// Natural frequencies of a fit to every block of experiments.
  Trace refit(int measured, const Case& of) const {
    ExperimentConfig config = config_;
    config.experiment.scheme = ExcitationScheme::orthogonal_dft;
    const ExperimentPlan plan = make_plan(config);
    auto loop = make_loop(plan, of);
    loop.next();
    const int block = plan.experiments() * (1 + measured);
    std::vector<std::vector<Eigen::MatrixXcd>> Z(plan.experiments());
    Trace trace;
    for (int p = 0; p < of.periods; ++p) {
      const int experiment = p % block / (1 + measured);
      if (p % (1 + measured) == 0) loop.excite(samples(plan, experiment));
      const PeriodSpectra period = loop.next();
      if (p % (1 + measured) > 0) {
        Z[experiment].emplace_back(model_.n_outputs() + model_.n_inputs(), period.Y.cols());
        Z[experiment].back() << period.Y, period.U;
      }
      trace.emplace_back();
      if (p % block + 1 < block) continue;
      trace.back() = fitted(Z);
      for (auto& runs : Z) runs.clear();
    }
    return trace;
  }

  /// Changes of the natural frequencies since the model.
  Trace siso(double memory, const Case& of) const {
    ExperimentConfig config = config_;
    auto& axes = config.experiment.axes;
    std::erase_if(axes, [&](const ExcitationAxis& axis) {
      return axis.channel != model_.inputs.name(input_);
    });
    const ExperimentPlan plan = make_plan(config);
    auto loop = make_loop(plan, of);
    loop.next();
    std::vector<Eigen::RowVectorXcd> learned;
    Eigen::RowVectorXcd mean;
    Eigen::RowVectorXd weight;
    Eigen::VectorXd estimate = Eigen::VectorXd::Zero(modes());
    const double kept = std::exp(-1.0 / memory);
    // Of the past, in periods: the learned ones have the estimate zero.
    double information = (1.0 - std::pow(kept, kLearning)) / (1.0 - kept);
    Trace trace;
    for (int p = 0; p < of.periods; ++p) {
      const PeriodSpectra period = loop.next();
      const Eigen::RowVectorXcd G = period.Y.row(output_).array() / period.U.row(input_).array();
      trace.emplace_back();
      if (p < kLearning) {
        learned.push_back(G);
        if (p + 1 < kLearning) continue;
        mean = Eigen::RowVectorXcd::Zero(G.size());
        for (const auto& g : learned) mean += g / kLearning;
        Eigen::RowVectorXd variance = Eigen::RowVectorXd::Zero(G.size());
        for (const auto& g : learned) variance += (g - mean).cwiseAbs2() / (kLearning - 1);
        weight = variance.cwiseInverse();
        continue;
      }
      information = kept * information + 1.0;
      for (Eigen::Index m = 0; m < modes(); ++m) {
        const Eigen::RowVectorXcd& d = sensitivity_[m];
        const double now =
            (weight.array() * (d.conjugate().array() * (G - mean).array()).real()).sum() /
            (weight.array() * d.array().abs2()).sum();
        estimate[m] += (now - estimate[m]) / information;
      }
      trace.back() = estimate;
    }
    return trace;
  }

 private:
  Eigen::MatrixXd samples(const ExperimentPlan& plan, int experiment) const {
    const auto& actuators = config_.stage.spec.info.actuators;
    const Eigen::MatrixXd of_axes = plan.excitation({0, experiment});
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(of_axes.rows(), std::ssize(actuators));
    for (Eigen::Index a = 0; a < of_axes.cols(); ++a)
      out.col(channel_index(actuators, plan.spec().axes[a].channel)) = of_axes.col(a);
    return out;
  }

  ExcitedLoop make_loop(const ExperimentPlan& plan, const Case& of) const {
    using Fault = SimulationSpec::Fault;
    SimulatedSpec spec{config_.stage.spec, *config_.stage.plant, config_.stage.simulation};
    spec.simulation.seed = of.seed;
    if (of.step != 0.0) {
      Fault fault;
      fault.kind = Fault::Kind::mode_frequency;
      fault.value = of.step;
      // One period precedes the first.
      fault.from_cycle = static_cast<std::uint64_t>(of.period + 1) *
                         static_cast<std::uint64_t>(plan.grid().samples_per_period());
      fault.channel = nearest_mode(spec.info, spec.plant, submodel(of.mode).natural_frequency_hz());
      spec.simulation.faults.push_back(fault);
    }
    return {
        spec,   samples(plan, 0), plan.grid().lines(), model_.inputs.names, model_.outputs.names,
        of.seed};
  }

  const Submodel& submodel(int mode) const { return model_.submodels[modes_[mode].index]; }

  Eigen::VectorXd fitted(const std::vector<std::vector<Eigen::MatrixXcd>>& Z) const {
    const Eigen::Index n_y = model_.n_outputs(), n_u = model_.n_inputs(), E = std::ssize(Z);
    FrfEstimate frf;
    frf.frequency_hz = frequency_hz_;
    frf.inputs = model_.inputs;
    frf.outputs = model_.outputs;
    frf.sample_rate_hz = config_.stage.spec.info.sample_rate_hz;
    frf.hold = Hold::zoh;
    frf.response.resize(n_y * n_u, frequency_hz_.size());
    frf.noise_variance.resize(n_y * n_u, frequency_hz_.size());
    const Eigen::VectorXd periods = Eigen::VectorXd::Constant(E, static_cast<double>(Z[0].size()));
    const int dof = static_cast<int>(E * (std::ssize(Z[0]) - 1));
    frf.noise_dof = dof;
    for (Eigen::Index k = 0; k < frequency_hz_.size(); ++k) {
      Eigen::MatrixXcd mean = Eigen::MatrixXcd::Zero(n_y + n_u, E);
      Eigen::MatrixXcd scatter = Eigen::MatrixXcd::Zero(n_y + n_u, n_y + n_u);
      for (Eigen::Index e = 0; e < E; ++e) {
        const auto& runs = Z[e];
        for (const auto& z : runs) mean.col(e) += z.col(k) / periods[e];
        for (const auto& z : runs) {
          const Eigen::VectorXcd deviation = z.col(k) - mean.col(e);
          scatter += deviation * deviation.adjoint();
        }
      }
      // With as many experiments as inputs, the response does not depend on the excitation's spectrum.
      const LineEstimate line = estimate_line(Eigen::MatrixXcd::Identity(n_u, E), mean, n_y);
      const LineNoise noise = line_noise(line, scatter, dof, periods);
      frf.response.col(k) = line.G.reshaped();
      frf.noise_variance.col(k) =
          (noise.residual.diagonal().real().asDiagonal() * noise.gain).reshaped();
    }
    FitOptions options;
    options.weighting = Weighting::noise_variance;
    options.hold = HoldModel::exact;
    options.delay_s = model_.mean_delay_s();
    options.uncertainty = false;
    options.threads = 1;
    const FitResult fit = fit_additive_model(frf, model_, options);
    Eigen::VectorXd out(modes());
    for (int m = 0; m < modes(); ++m)
      out[m] = fit.model.submodels[modes_[m].index].natural_frequency_hz() /
                   submodel(m).natural_frequency_hz() -
               1.0;
    return out;
  }

  /// The pair that shows the worst mode best, relative to the best pair for it.
  void choose_channels() {
    const TrackedResponse response(model_, modes_, frequency_hz_);
    constexpr double kSmall = 1e-7;
    const Eigen::MatrixXcd P = response.at(Eigen::VectorXd::Zero(modes()));
    std::vector<Eigen::MatrixXcd> d;
    Eigen::VectorXd least = Eigen::VectorXd::Constant(P.rows(), 1.0);
    for (int m = 0; m < modes(); ++m) {
      d.emplace_back((response.at(kSmall * Eigen::VectorXd::Unit(modes(), m)) - P) / kSmall);
      const double hz = submodel(m).natural_frequency_hz();
      const double within_hz = std::max(4.0 * submodel(m).damping_ratio() * hz,
                                        1.5 * (frequency_hz_[1] - frequency_hz_[0]));
      for (Eigen::Index k = 0; k < frequency_hz_.size(); ++k)
        if (std::abs(frequency_hz_[k] - hz) > within_hz) d.back().col(k).setZero();
      const Eigen::VectorXd size = d.back().rowwise().norm();
      least = least.cwiseMin(size / size.maxCoeff());
    }
    Eigen::Index channel = 0;
    least.maxCoeff(&channel);
    output_ = channel % model_.n_outputs();
    input_ = channel / model_.n_outputs();
    for (const Eigen::MatrixXcd& of_mode : d) sensitivity_.emplace_back(of_mode.row(channel));
  }

  ExperimentConfig config_;
  AdditiveModel model_;
  Eigen::VectorXd frequency_hz_;
  std::vector<TrackedParameter> modes_;
  Eigen::Index output_ = 0, input_ = 0;
  std::vector<Eigen::RowVectorXcd> sensitivity_;  // by mode, zero far from it
};

struct Method {
  std::string name;
  std::function<Trace(const Case&)> trace;
  bool decides = false;  ///< its trace is one for an alarm
};

/// The exact mean and deviation of a method's values, and its threshold.
struct Calibration {
  Eigen::ArrayXd mean, deviation;
  double threshold = 0.5;

  double statistic(const Eigen::VectorXd& values) const {
    return values.size() == 0 ? 0.0 : ((values.array() - mean) / deviation).abs().maxCoeff();
  }
  /// The first alarm from period `from` on; -1: none.
  int first_alarm(const Trace& trace, int from) const {
    for (int p = from; p < std::ssize(trace); ++p)
      if (statistic(trace[p]) > threshold) return p;
    return -1;
  }
};

Calibration calibrate(const Method& method, const std::vector<Trace>& quiet) {
  Calibration out;
  if (method.decides) {
    out.mean = Eigen::ArrayXd::Zero(1);
    out.deviation = Eigen::ArrayXd::Ones(1);
    return out;
  }
  Eigen::ArrayXd sum, squares;
  double count = 0.0;
  for (const Trace& trace : quiet)
    for (const Eigen::VectorXd& values : trace) {
      if (values.size() == 0) continue;
      if (count == 0.0) sum = squares = Eigen::ArrayXd::Zero(values.size());
      sum += values.array();
      squares += values.array().square();
      count += 1.0;
    }
  out.mean = sum / count;
  out.deviation = (squares / count - out.mean.square()).sqrt();
  // With alarms at the wanted rate, this share of the runs has none.
  std::vector<double> largest;
  for (const Trace& trace : quiet) {
    largest.push_back(0.0);
    for (int p = kLearning; p < std::ssize(trace); ++p)
      largest.back() = std::max(largest.back(), out.statistic(trace[p]));
  }
  std::sort(largest.begin(), largest.end());
  out.threshold = largest[static_cast<std::size_t>(std::exp(-kFalseAlarms * kQuiet) *
                                                   static_cast<double>(largest.size()))];
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const ExperimentConfig config = load_experiment_config(argv[1]);
  const Bench bench(config, read_model(argv[2]));
  const int runs = argc > 3 ? std::atoi(argv[3]) : 100;
  const int quiet_runs = argc > 4 ? std::atoi(argv[4]) : 200;
  const auto first = static_cast<std::uint64_t>(argc > 5 ? std::atoi(argv[5]) : 1);
  const int axes = static_cast<int>(config.experiment.axes.size());

  std::vector<Method> methods = {
      {"watch", [&](const Case& of) { return bench.watch(config, of); }, true}};
  if (argc > 6 && std::string(argv[6]) != "-")
    methods.push_back({"watch, designed",
                       [&bench, designed = load_experiment_config(argv[6])](const Case& of) {
                         return bench.watch(designed, of);
                       },
                       true});
  for (const int measured : {3, 9})
    methods.push_back({fmt::format("refit {}", axes * (1 + measured)),
                       [&bench, measured](const Case& of) { return bench.refit(measured, of); }});
  for (const double memory : {10.0, 50.0})
    methods.push_back({fmt::format("siso {:.0f}", memory),
                       [&bench, memory](const Case& of) { return bench.siso(memory, of); }});
  fmt::print("siso: {}\n", bench.siso_name());

  for (const Method& method : methods) {
    if (argc > 7 && method.name != argv[7]) continue;
    std::vector<Trace> quiet;
    for (int run = 0; run < quiet_runs; ++run)
      quiet.push_back(method.trace({first + static_cast<std::uint64_t>(run)}));
    const Calibration calibration = calibrate(method, quiet);
    int silent = 0;
    for (const Trace& trace : quiet)
      if (calibration.first_alarm(trace, kLearning) < 0) ++silent;
    fmt::print(
        "{:16} threshold {:.2f}, quiet runs: {:.2f} alarms per 1000 periods, deviations {:.2g}\n",
        method.name, calibration.threshold, -1e3 * std::log(silent / (1.0 * quiet_runs)) / kQuiet,
        fmt::join(calibration.deviation, " "));
    double watched = 0.0, early = 0.0;
    for (const double step : {1e-5, 1e-4, 1e-3}) {
      std::vector<int> delays, told(static_cast<std::size_t>(bench.modes())), planted = told;
      int counted = 0;
      for (int run = 0; run < runs; ++run) {
        Case of{first + static_cast<std::uint64_t>(quiet_runs + run)};
        RandomNumbers random(of.seed);
        of.mode = random.integer(0, bench.modes() - 1);
        of.step = (random.integer(0, 1) == 0 ? 1.0 : -1.0) * step;
        // Anywhere in a block of refits.
        of.period = kLearning + 8 + random.integer(0, 10 * axes - 1);
        of.periods = of.period + kAfter;
        const int alarm = calibration.first_alarm(method.trace(of), kLearning);
        const bool too_early = alarm >= 0 && alarm < of.period;
        watched += (too_early ? alarm : of.period) - kLearning;
        early += too_early ? 1.0 : 0.0;
        if (too_early) continue;
        ++counted;
        ++planted[of.mode];
        if (alarm < 0) continue;
        ++told[of.mode];
        delays.push_back(alarm - of.period + 1);
      }
      std::sort(delays.begin(), delays.end());
      const auto part = [&](double share) {
        const auto i = static_cast<std::size_t>(share * counted);
        return i < delays.size() ? std::to_string(delays[i]) : fmt::format("> {}", kAfter);
      };
      fmt::print(
          "  step {:.0e}: delay median {}, 95 % {} periods; detected {} of {}, by mode {} of {}\n",
          step, part(0.5), part(0.95), delays.size(), counted, fmt::join(told, " "),
          fmt::join(planted, " "));
    }
    fmt::print("  before the step: {:.2f} alarms per 1000 periods ({:.0f} in {:.0f})\n",
               1e3 * early / watched, early, watched);
    std::fflush(stdout);
  }
}
