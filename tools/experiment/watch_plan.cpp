#include "tools/experiment/watch_plan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <complex>
#include <iterator>
#include <numbers>
#include <string_view>

#include "acquisition/files/fail.hpp"
#include "acquisition/loop/excited_actuators.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/multisine/multisine_lines.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/response/hold_compensation.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/plant_prior_file.hpp"

namespace stageid {
namespace {

using Eigen::Index;

/// Lines are dropped that have a smaller share in the optimum and in the information on each natural frequency.
constexpr double kNegligible = 1e-3;
/// Rounds of power and phases. Twice as many lower the deviations by 1 %.
constexpr int kRounds = 8;
constexpr double kYear_s = 365.25 * 86400.0;

std::vector<Index> places(const std::vector<std::string>& names,
                          const std::vector<Channel>& channels, const ExperimentConfig& config) {
  std::vector<Index> out;
  for (const std::string& name : names) {
    const int index = channel_index(channels, name);
    if (index < 0)
      fail_format(
          config.file, "",
          "--watch: the stage lacks the channel '{}' of the model; use a model of this stage",
          name);
    out.push_back(index);
  }
  return out;
}

double period_s(const ExperimentConfig& config) {
  return config.samples_per_period / config.stage.spec.info.sample_rate_hz;
}

FrfEstimate with_outputs(const FrfEstimate& frf, const AdditiveModel& model,
                         const ExperimentConfig& config) {
  try {
    return select_channels(frf, frf.inputs.names, model.outputs.names);
  } catch (const std::invalid_argument& error) {
    fail_format(config.file, "", "--frf: {}; use the FRF from which the model was fitted",
                error.what());
  }
}

/// As measured, because the model of a stage that works includes hold and delay. @throws FormatError
FrfEstimate read_noise(const WatchRequest& request, const Eigen::VectorXd& frequency_hz) {
  FrfEstimate frf = read_frf(request.frf);
  if (frf.compensated != Compensation::none) frf = as_measured(std::move(frf));
  const double low_hz = frf.frequency_hz[0];
  const double high_hz = frf.frequency_hz[frf.lines() - 1];
  if (frequency_hz[0] < 0.98 * low_hz || frequency_hz[frequency_hz.size() - 1] > 1.02 * high_hz)
    fail_format(request.frf, "/frequency_hz",
                "{:.6g} ... {:.6g} Hz do not cover band_hz of the experiment; narrow band_hz",
                low_hz, high_hz);
  return frf;
}

/// What a stage reveals about its tracked parameters on some lines if every line has the whole power of every axis.
class WatchedStage {
 public:
  WatchedStage(const ExperimentConfig& config, const AdditiveModel& model, const FrfEstimate& frf,
               const Eigen::VectorXd& frequency_hz)
      : response_(
            model,
            tracked_parameters(model, {frequency_hz[0], frequency_hz[frequency_hz.size() - 1]}),
            frequency_hz) {
    const StageSpec& stage = config.stage.spec;
    const std::vector<Index> inputs = places(model.inputs.names, stage.info.actuators, config);
    const std::vector<Index> outputs = places(model.outputs.names, stage.info.sensors, config);
    const std::vector<Eigen::MatrixXcd> noise =
        output_noise(with_outputs(frf, model, config), frequency_hz, period_s(config));
    if (noise.empty())
      throw FormatError(config.file, "",
                        "--frf: has no noise estimate; use an FRF of `stageid frf` from two or "
                        "more periods");
    const auto n_u = static_cast<Index>(stage.info.actuators.size());
    const auto n_y = static_cast<Index>(stage.info.sensors.size());
    // |DFT / N|^2 of a line is half of its mean square.
    Eigen::MatrixXd R = Eigen::MatrixXd::Zero(n_u, std::ssize(config.experiment.axes));
    const std::vector<int> excited = excited_actuators(config.experiment, stage.info);
    for (std::size_t j = 0; j < excited.size(); ++j)
      R(excited[j], static_cast<Index>(j)) = config.experiment.axes[j].level / std::numbers::sqrt2;
    const Eigen::MatrixXcd P = response_.at(Eigen::VectorXd::Zero(response_.size()));
    const MotionController controller(stage.controller);
    std::vector<Eigen::MatrixXcd> U;
    for (Index k = 0; k < frequency_hz.size(); ++k) {
      // u = (I - K G)^-1 r. What the model lacks is left out of the loop.
      Eigen::MatrixXcd G = Eigen::MatrixXcd::Zero(n_y, n_u);
      G(outputs, inputs) = P.col(k).reshaped(model.n_outputs(), model.n_inputs());
      Eigen::MatrixXcd difference = Eigen::MatrixXcd::Identity(n_u, n_u);
      if (!stage.controller.by_peer) difference -= controller.response(frequency_hz[k]) * G;
      const Eigen::MatrixXcd u = solve(difference, R.cast<std::complex<double>>());
      U.emplace_back(u(inputs, Eigen::all));
      motion_.emplace_back(std::numbers::sqrt2 * G(outputs, Eigen::all) * u);
    }
    sensitivity_ = line_sensitivities(response_, U, noise);
    free_motion_ = line_motions(response_, noise);
  }

  const TrackedResponse& response() const noexcept { return response_; }
  const LineSensitivity& at(Index k) const { return sensitivity_[k]; }

  /// @param r  axes x lines, |r|^2 the share of the power
  std::vector<Eigen::MatrixXd> information(const Eigen::MatrixXcd& r) const {
    std::vector<Eigen::MatrixXd> out;
    for (Index k = 0; k < r.cols(); ++k)
      out.push_back(stageid::information(sensitivity(at(k), r.col(k))));
    return out;
  }
  /// Mean squares over their limits: of every axis its own level or, with `rms_m`, of every sensor this rms.
  Eigen::MatrixXd use_of_limits(const Eigen::MatrixXcd& r, double rms_m) const {
    if (!(rms_m > 0.0)) return Eigen::MatrixXd::Ones(1, r.cols());
    Eigen::MatrixXd use(motion_.front().rows(), r.cols());
    for (Index k = 0; k < r.cols(); ++k)
      use.col(k) = (motion_[k] * r.col(k)).cwiseAbs2() / (rms_m * rms_m);
    return use;
  }
  Eigen::MatrixXd prior() const {
    return prior_information(response_.parameters(), response_.model().sample_rate_hz);
  }
  /// Of the natural frequencies; 0 of all others.
  Eigen::VectorXd change(double drift) const {
    Eigen::VectorXd change = Eigen::VectorXd::Zero(response_.size());
    for (Index p = 0; p < change.size(); ++p)
      if (response_.parameters()[p].kind == TrackedKind::frequency) change[p] = drift;
    return change;
  }
  /// By the lines of which r is not zero: only these are watched.
  WatchForecast forecast(const Eigen::MatrixXcd& r, double drift, double period) const {
    TrackerOptions options;
    options.false_alarms_per_period = std::min(0.1, period / kYear_s);
    std::vector<Eigen::MatrixXcd> J, free_motion;
    for (Index k = 0; k < r.cols(); ++k) {
      if (r.col(k).isZero(0.0)) continue;
      J.push_back(sensitivity(at(k), r.col(k)));
      free_motion.push_back(free_motion_[k]);
    }
    return watch_forecast(J, free_motion, prior(), change(drift), options);
  }

 private:
  TrackedResponse response_;
  std::vector<LineSensitivity> sensitivity_;
  std::vector<Eigen::MatrixXcd> free_motion_;
  std::vector<Eigen::MatrixXcd> motion_;
};

Eigen::MatrixXcd unit_phasors(const Eigen::MatrixXd& phase_rad) {
  return phase_rad.unaryExpr([](double phase) { return std::polar(1.0, phase); });
}

/// A text as a value of a YAML file.
std::string in_yaml(const std::string& text) {
  const bool plain = std::ranges::all_of(text, [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("_./").find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (plain && !text.empty()) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("''") : std::string(1, c);
  return quoted + "'";
}

struct JointDesign {
  InformativePower power;
  Eigen::MatrixXcd r;
};

/// Power and phases in turns. The phases answer the mean weight of all rounds (fictitious play); those for the last
/// weight alone would oscillate between the modes.
JointDesign design(const WatchedStage& stage, Eigen::MatrixXcd r, const WatchRequest& request) {
  Eigen::MatrixXd V(stage.response().size(), 0);
  JointDesign best;
  for (int round = 0; round < kRounds; ++round) {
    InformativePower power =
        most_informative_power(stage.information(r), stage.prior(), stage.change(request.drift),
                               stage.use_of_limits(r, request.rms_m));
    const Index n = power.gradient_root.cols();
    V.conservativeResize(Eigen::NoChange, V.cols() + n);
    V.rightCols(n) = power.gradient_root;
    if (round == 0 || power.variance.maxCoeff() < best.power.variance.maxCoeff())
      best = {std::move(power), r};
    for (Index k = 0; k < r.cols(); ++k)
      r.col(k) = most_informative_phases(stage.at(k), V, r.col(k));
  }
  return best;
}

}  // namespace

WatchForecast forecast_of(const ExperimentConfig& config, const AdditiveModel& model,
                          const FrfEstimate& frf, double drift) {
  const WatchedStage stage(config, model, frf, grid_of(config).frequency_hz());
  const ExperimentPlan plan = outline_plan(config);
  Eigen::MatrixXd share = plan.amplitude() / std::numbers::sqrt2;
  for (Index j = 0; j < share.rows(); ++j) share.row(j) /= config.experiment.axes[j].level;
  return stage.forecast(unit_phasors(plan.phase_rad(0)).cwiseProduct(share), drift,
                        period_s(config));
}

WatchPlan make_watch_plan(const ExperimentConfig& config, const WatchRequest& request) {
  if (config.limits || config.experiment.scaling != AmplitudeScaling::rms)
    throw FormatError(config.file, "", "--watch: needs 'level: {rms_n: ...}'");
  const FrequencyGrid candidates = grid_of(config);
  const FrfEstimate frf = read_noise(request, candidates.frequency_hz());
  WatchPlan plan;
  plan.model = read_model(request.model);
  const WatchedStage stage(config, plan.model, frf, candidates.frequency_hz());
  if (stage.change(1.0).isZero(0.0))
    fail_format(request.model, "", "has no mode between {:.6g} and {:.6g} Hz; widen band_hz in {}",
                candidates.frequency_hz()[0], candidates.frequency_hz()[candidates.size() - 1],
                config.file.string());
  const JointDesign best = design(stage, unit_phasors(outline_plan(config).phase_rad(0)), request);
  const Eigen::MatrixXd use = stage.use_of_limits(best.r, request.rms_m);
  const std::vector<Eigen::MatrixXd> information = stage.information(best.r);
  Eigen::VectorXd power = best.power.power;
  Eigen::ArrayXd sum = Eigen::ArrayXd::Zero(stage.response().size());
  for (std::size_t k = 0; k < information.size(); ++k)
    sum += power[k] * information[k].diagonal().array();
  for (std::size_t k = 0; k < information.size(); ++k) {
    double& p = power[k];
    const Eigen::MatrixXd& V = best.power.gradient_root;
    const Eigen::ArrayXd shares = p * information[k].diagonal().array() / sum;
    if ((stage.change(1.0).array() * shares).maxCoeff() < kNegligible &&
        p * (V.transpose() * information[k] * V).trace() < kNegligible)
      p = 0.0;
  }
  // The first and the last line stay: ModelTracker looks for modes between them.
  for (const Index k : {Index{0}, power.size() - 1})
    power[k] = std::max(power[k], kNegligible / use.col(k).maxCoeff());
  power /= (use * power).maxCoeff();
  const Eigen::MatrixXcd r = best.r * power.cwiseSqrt().asDiagonal();
  std::vector<Index> kept;
  for (Index k = 0; k < power.size(); ++k)
    if (power[k] > 0.0) kept.push_back(k);
  for (const Index k : kept) plan.lines.push_back(candidates.lines()[k]);
  plan.parameters = stage.response().parameters();
  plan.forecast = stage.forecast(r, request.drift, period_s(config));
  plan.gap = best.power.gap;
  plan.shape = (power(kept) / power.maxCoeff()).cwiseSqrt();
  plan.phase_rad = best.r(Eigen::all, kept).unaryExpr(&positive_phase_rad);
  for (const ExcitationAxis& axis : config.experiment.axes)
    plan.levels.push_back(axis.level * std::sqrt(power.sum()));
  return plan;
}

std::string watch_experiment_text(const WatchPlan& plan, const ExperimentConfig& config,
                                  const std::filesystem::path& file) {
  const ExperimentSpec& experiment = config.experiment;
  const Eigen::VectorXd frequency_hz =
      FrequencyGrid(config.stage.spec.info.sample_rate_hz, config.samples_per_period, plan.lines)
          .frequency_hz();
  std::vector<std::string> axes, points, phases;
  for (std::size_t j = 0; j < experiment.axes.size(); ++j) {
    axes.push_back(in_yaml(experiment.axes[j].channel));
    phases.push_back(fmt::format("    - {{axis: {}, rad: [{:.4f}]}}\n", axes.back(),
                                 fmt::join(plan.phase_rad.row(j), ", ")));
  }
  for (Index k = 0; k < plan.shape.size(); ++k)
    points.push_back(fmt::format("[{}, {:.5g}]", frequency_hz[k], plan.shape[k]));
  std::vector<std::string> outputs;
  std::ranges::transform(plan.model.outputs.names, std::back_inserter(outputs), &in_yaml);
  return fmt::format(
      "# Permanent excitation for tracking a model, by `stageid design --watch`.\n"
      "format: stageid-experiment\nstage: {}\n\nexperiment:\n  axes: [{}]\n  scheme: simultaneous\n"
      "  level: {{rms: [{:.6g}]}}\n  band_hz: [{}, {}]\n  period_s: {}\n  transient_periods: {}\n"
      "  periods: {}\n  realizations: 1\n  crest_iterations: 0\n  seed: {}\n  lines: [{}]\n"
      "  shape: [{}]\n  phases:\n{}\nfrf:\n  outputs: [{}]\n",
      in_yaml(std::filesystem::proximate(std::filesystem::absolute(config.stage.file),
                                         std::filesystem::absolute(file).parent_path())
                  .string()),
      fmt::join(axes, ", "), fmt::join(plan.levels, ", "), frequency_hz[0],
      frequency_hz[frequency_hz.size() - 1], period_s(config), experiment.transient_periods,
      experiment.periods, experiment.seed, fmt::join(plan.lines, ", "), fmt::join(points, ", "),
      fmt::join(phases, ""), fmt::join(outputs, ", "));
}

}  // namespace stageid
