#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "acquisition/loop/run_experiment.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/multisine/dft.hpp"
#include "hal/simulator/modal_plant.hpp"
#include "hal/simulator/noise.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tests/support/judgement/judgement_trouble.hpp"
#include "tests/support/logs/faulty_log.hpp"

namespace stageid::test {
namespace {

constexpr Eigen::Index kSpareSamples = 64;  // behind a run: recordings that are late need them
constexpr Eigen::Index kHeave = 2;          // of plant_modes()
constexpr int kRetunePeriod = 64;           // samples

void quantize(Eigen::Ref<Eigen::VectorXd> values, double quantum) {
  if (quantum == 0.0) return;
  for (double& value : values) value = quantum * std::nearbyint(value / quantum);
}

NoiseSpec white_noise_of(const SimulatedSpec& spec) {
  return {static_cast<Eigen::Index>(spec.info.actuators.size()),
          static_cast<Eigen::Index>(spec.info.sensors.size()),
          spec.info.sample_rate_hz,
          spec.simulation.force_noise_n,
          spec.simulation.sensor_noise_m,
          0.0,
          1.0};
}

/// Slow, smooth, and without the measurement's period: three sines of golden ratios.
double setpoint(double turns) {
  constexpr double kTwoPi = 6.283185307179586;
  return std::sin(kTwoPi * 0.31 * turns) + 0.6 * std::sin(kTwoPi * 0.5017 * turns + 1.0) +
         0.3 * std::sin(kTwoPi * 1.3124 * turns + 2.0);
}

/// The closed loop, sample by sample.
class Loop {
 public:
  Loop(const JudgementStage& stage, const TroublePlan& plan)
      : stage_(stage),
        plan_(plan),
        plant_(plant_modes(stage.spec.info, stage.spec.plant), stage.spec.info.delay_s,
               stage.spec.info.sample_rate_hz),
        controller_(stage.spec.controller),
        noise_(white_noise_of(stage.spec)),
        coloured_(stage.noise),
        y_(plant_.sensors()),
        seen_(plant_.sensors()),
        u_(plant_.actuators()),
        force_(plant_.actuators()) {
    if (plan.friction_n > 0.0) friction_.emplace(plan.friction_n, plan.friction_stiffness_n_m);
    for (const Channel& c : stage.spec.info.sensors) heave_.push_back(c.direction[2]);
  }

  /// @param done share of the experiment before and behind this run
  LogSamples run(const Eigen::MatrixXd& r, Eigen::Index samples, std::uint64_t seed,
                 std::pair<double, double> done, int number = -1) {
    plant_.reset();
    change(number >= plan_.changed_from && number < plan_.changed_to);
    controller_.reset();
    noise_.restart(stage_.spec.simulation.seed + stage_.seed, seed);
    coloured_.restart(~stage_.seed, seed);
    if (friction_) friction_->reset();
    LogSamples record;
    record.actuators.resize(samples, u_.size());
    record.sensors.resize(samples, y_.size());
    for (Eigen::Index n = 0; n < samples; ++n) {
      const double share = static_cast<double>(n) / static_cast<double>(samples);
      if (plan_.drifting_mode >= 0 && n % kRetunePeriod == 0)
        drift(done.first + (done.second - done.first) * share);
      measure(static_cast<double>(n) / static_cast<double>(r.rows()));
      controller_.update(seen_.data(), u_.data());
      u_ += r.row(n % r.rows()).transpose();
      record.sensors.row(n) = y_;
      record.actuators.row(n) = u_;
      push();
    }
    return record;
  }

 private:
  /// Of the stage in some runs.
  void change(bool changed) {
    gain_ = Eigen::VectorXd::Ones(plant_.actuators());
    if (changed && plan_.changed_actuator >= 0) gain_[plan_.changed_actuator] = plan_.changed_gain;
    if (plan_.changed_modes == 0.0) return;
    const std::vector<PlantMode> modes = plant_modes(stage_.spec.info, stage_.spec.plant);
    for (std::size_t i = kRigidAxes; i < modes.size(); ++i)
      plant_.retune(static_cast<Eigen::Index>(i),
                    modes[i].natural_frequency_hz * (changed ? 1.0 + plan_.changed_modes : 1.0),
                    modes[i].damping_ratio);
  }

  void drift(double done) {
    const PlantMode& mode = stage_.spec.plant.in_plane_modes[plan_.drifting_mode];
    plant_.retune(static_cast<Eigen::Index>(kRigidAxes) + plan_.drifting_mode,
                  mode.natural_frequency_hz * (1.0 + plan_.drift_relative * (done - 0.5)),
                  mode.damping_ratio);
  }

  void measure(double turns) {
    plant_.output(y_.data());
    noise_.next();
    y_ += Eigen::Map<const Eigen::VectorXd>(noise_.sensor_m(), y_.size());
    y_ += coloured_.next().matrix();
    quantize(y_, plan_.sensor_quantum_m);
    if (!(y_.cwiseAbs().maxCoeff() < 1e6)) throw LoopRanAway("judgement stage: the loop ran away");
    seen_ = y_;
    if (plan_.setpoint_m == 0.0) return;
    for (Eigen::Index i = 0; i < y_.size(); ++i)
      seen_[i] -= heave_[i] * plan_.setpoint_m * setpoint(turns);
  }

  void push() {
    force_ = u_.cwiseProduct(gain_);
    if (plan_.actuator_limit_n > 0.0)
      force_ = force_.cwiseMax(-plan_.actuator_limit_n).cwiseMin(plan_.actuator_limit_n);
    quantize(force_, plan_.actuator_quantum_n);
    force_ += Eigen::Map<const Eigen::VectorXd>(noise_.force_n(), force_.size());
    const double shape = 1.0 / std::sqrt(stage_.spec.plant.mass_kg);
    const double z_m = shape * plant_.coordinate(kHeave);
    double extra_n = -plan_.cubic_n_m3 * z_m * z_m * z_m;
    if (friction_) extra_n += friction_->move_to(z_m);
    if (extra_n != 0.0) plant_.add_modal_force(kHeave, shape * extra_n);
    plant_.step(force_.data());
  }

  const JudgementStage& stage_;
  const TroublePlan& plan_;
  ModalPlant plant_;
  MotionController controller_;
  StageNoise noise_;
  ColouredNoise coloured_;
  std::optional<DahlFriction> friction_;
  std::vector<double> heave_;
  Eigen::VectorXd y_;
  Eigen::VectorXd seen_;  // input of the controller: the error from the setpoint
  Eigen::VectorXd u_;
  Eigen::VectorXd force_;
  Eigen::VectorXd gain_;  // of the actuators in this run
};

void lose_sample(LogSamples& record, Eigen::Index at) {
  for (Eigen::MatrixXd* x : {&record.actuators, &record.sensors}) {
    const Eigen::Index rest = x->rows() - at - 1;
    x->middleRows(at, rest) = x->bottomRows(rest).eval();
  }
}

/// What only the recorder does, to a run that is kSpareSamples too long.
void spoil(const TroublePlan& plan, int run, Eigen::Index transient, MemoryLog& log) {
  LogSamples& record = log.records.back();
  const Eigen::Index samples = record.sensors.rows() - kSpareSamples;
  if (plan.late >= 0) {
    Eigen::MatrixXd& x = plan.late_sensor ? record.sensors : record.actuators;
    x.col(plan.late) = delayed(x.col(plan.late), plan.late_samples);
  }
  if (run == plan.lost_run)
    lose_sample(record, transient + static_cast<Eigen::Index>(
                                        plan.lost_at * static_cast<double>(samples - transient)));
  record.actuators.conservativeResize(samples, Eigen::NoChange);
  record.sensors.conservativeResize(samples, Eigen::NoChange);
  Eigen::MatrixXd& r = log.excitation_periods.back();
  if (plan.excitation_as_actuators)
    for (Eigen::Index n = 0; n < samples; ++n) record.actuators.row(n) = r.row(n % r.rows());
  if (plan.swapped[0] >= 0)
    record.sensors.col(plan.swapped[0]).swap(record.sensors.col(plan.swapped[1]));
  if (plan.reference_late_samples > 0) {
    const Eigen::Index late = plan.reference_late_samples;
    const Eigen::MatrixXd original = r;
    for (Eigen::Index n = 0; n < r.rows(); ++n) r.row((n + late) % r.rows()) = original.row(n);
  }
}

}  // namespace

MemoryLog measure_with_trouble(const JudgementStage& stage, const TroublePlan& plan) {
  const ExperimentPlan experiment = stage.plan();
  const Eigen::Index period = stage.period_samples;
  const Eigen::Index transient = period * stage.transient_periods;
  const Eigen::Index samples = transient + period * stage.periods;
  MemoryLog log;
  log.file = "judgement.h5";
  log.log_info.sample_rate_hz = stage.spec.info.sample_rate_hz;
  log.log_info.period_samples = stage.period_samples;
  log.log_info.transient_periods = stage.transient_periods;
  log.log_info.actuators = list_of(stage.spec.info.actuators);
  log.log_info.sensors = list_of(stage.spec.info.sensors);
  log.log_info.excitation = log.log_info.actuators;
  Loop loop(stage, plan);
  const std::vector<RunId> runs = experiment.runs();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    Eigen::MatrixXd planned = experiment.excitation(runs[i]);
    Eigen::MatrixXd r = planned;
    if (plan.silent_axis >= 0) r.col(plan.silent_axis).setZero();
    const auto done = [&](std::size_t n) {
      return static_cast<double>(n) / static_cast<double>(runs.size());
    };
    LogSamples record = loop.run(r, samples + kSpareSamples, run_seed(stage.seed, runs[i]),
                                 {done(i), done(i + 1)}, static_cast<int>(i));
    log.append(runs[i].realization, runs[i].experiment,
               plan.silent_in_record ? std::move(r) : std::move(planned), std::move(record));
    spoil(plan, static_cast<int>(i), transient, log);
    log.log_runs.back().samples = static_cast<std::uint64_t>(samples);
    log.records.back().marked.setZero(samples);
  }
  return log;
}

Eigen::MatrixXcd best_linear_approximation(const JudgementStage& stage, const TroublePlan& plan) {
  constexpr int kRealizations = 20;
  JudgementStage quiet = stage;
  quiet.seed = ~stage.seed;
  quiet.realizations = kRealizations;
  quiet.spec.simulation.sensor_noise_m = quiet.spec.simulation.force_noise_n = 0.0;
  quiet.noise.colour = NoiseColour::white;
  quiet.noise.density = 0.0;
  const ExperimentPlan experiment = quiet.plan();
  const std::vector<int>& lines = experiment.grid().lines();
  const auto n_y = static_cast<Eigen::Index>(stage.spec.info.sensors.size());
  const auto n_u = static_cast<Eigen::Index>(stage.spec.info.actuators.size());
  const Eigen::Index E = experiment.experiments();
  const Eigen::Index period = stage.period_samples;
  const Eigen::Index samples = period * (stage.transient_periods + 1);
  Loop loop(quiet, plan);
  RealDft dft(stage.period_samples);
  std::vector<Eigen::MatrixXcd> Z(lines.size(), Eigen::MatrixXcd(n_y + n_u, E));
  std::vector<Eigen::MatrixXcd> R(lines.size(), Eigen::MatrixXcd(n_u, E));
  std::vector<Eigen::MatrixXcd> sum(lines.size(), Eigen::MatrixXcd::Zero(n_y + n_u, n_u));
  const auto take = [&](const auto& signal, std::vector<Eigen::MatrixXcd>& into, Eigen::Index row,
                        Eigen::Index e) {
    std::copy(signal.begin(), signal.end(), dft.input().begin());
    const auto spectrum = dft.forward();
    for (std::size_t k = 0; k < lines.size(); ++k) into[k](row, e) = spectrum[lines[k]];
  };
  for (const RunId& run : experiment.runs()) {
    const Eigen::MatrixXd r = experiment.excitation(run);
    const LogSamples record = loop.run(r, samples, 1, {0.0, 1.0});
    const Eigen::Index e = run.experiment;
    for (Eigen::Index i = 0; i < n_y; ++i) take(record.sensors.col(i).tail(period), Z, i, e);
    for (Eigen::Index j = 0; j < n_u; ++j) {
      take(record.actuators.col(j).tail(period), Z, n_y + j, e);
      take(r.col(j), R, j, e);
    }
    if (e + 1 < E) continue;  // a realization is complete
    for (std::size_t k = 0; k < lines.size(); ++k) sum[k] += Z[k] * inverse(R[k]);
  }
  Eigen::MatrixXcd G(n_y * n_u, static_cast<Eigen::Index>(lines.size()));
  for (std::size_t k = 0; k < lines.size(); ++k)
    G.col(k) = (sum[k].topRows(n_y) * inverse(sum[k].bottomRows(n_u))).reshaped();
  return G;
}

}  // namespace stageid::test
