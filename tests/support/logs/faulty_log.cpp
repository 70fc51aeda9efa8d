#include "tests/support/logs/faulty_log.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "excitation/multisine/frequency_grid.hpp"
#include "excitation/multisine/multisine.hpp"
#include "hal/simulator/modal_plant.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {

ChannelList list_of(const std::vector<Channel>& channels) {
  ChannelList list;
  for (const Channel& channel : channels) {
    list.names.push_back(channel.name);
    list.units.push_back(channel.unit);
  }
  return list;
}

namespace {

using Kind = PlantedFault::Kind;

constexpr int kTaps = 32;               // a side, of the fractional delay
constexpr Eigen::Index kRetuned = 200;  // samples between changes of a mode that drifts

/// One run of the loop.
class Loop {
 public:
  Loop(const FaultyLogRequest& request, const PlantedFault& fault)
      : request_(request),
        fault_(fault),
        plant_(plant_modes(request.stage.info, request.stage.plant), request.stage.info.delay_s,
               request.stage.info.sample_rate_hz),
        late_(plant_modes(request.stage.info, request.stage.plant),
              request.stage.info.delay_s + (fault.kind == Kind::wired_skew ? fault.value : 0.0),
              request.stage.info.sample_rate_hz),
        controller_(request.configured.controller),
        y_(plant_.sensors()),
        y_late_(plant_.sensors()),
        u_(plant_.actuators()),
        force_(plant_.actuators()),
        window_m_(1e-3) {
    if (fault.kind != Kind::drifting_mode) return;
    const PlantMode mode = plant_modes(request.stage.info, request.stage.plant)[fault.a];
    mode_hz_ = mode.natural_frequency_hz;
    mode_damping_ = mode.damping_ratio;
  }

  /// @returns false if the loop ran away.
  /// @param before  the part of the measurement that lies before this run; `share`: that this run is
  bool run(const Eigen::MatrixXd& r, const Eigen::VectorXd& hidden, Eigen::Index samples,
           std::uint64_t seed, double before, double share, LogSamples& record) {
    RandomNumbers random(seed);
    plant_.reset();
    late_.reset();
    controller_.reset();
    record.sensors.resize(samples, y_.size());
    record.actuators.resize(samples, u_.size());
    record.marked.setZero(samples);
    for (Eigen::Index n = 0; n < samples; ++n) {
      if (fault_.kind == Kind::drifting_mode && n % kRetuned == 0) {
        const double passed =
            before + share * static_cast<double>(n) / static_cast<double>(samples) - 0.5;
        plant_.retune(fault_.a, mode_hz_ * (1.0 + fault_.value * passed), mode_damping_);
      }
      measure(random, n, samples);
      if (!(y_.cwiseAbs().maxCoeff() < window_m_)) return false;
      controller_.update(y_.data(), u_.data());
      u_.head(r.cols()) += r.row(n % r.rows()).transpose();
      if (fault_.kind == Kind::hidden_excitation) u_[fault_.a] += hidden[n % r.rows()];
      if (fault_.kind == Kind::saturation && !fault_.of_sensor)
        u_[fault_.a] = std::clamp(u_[fault_.a], -fault_.value, fault_.value);
      record.sensors.row(n) = y_;
      record.actuators.row(n) = u_;
      push();
    }
    return true;
  }

 private:
  void measure(RandomNumbers& random, Eigen::Index n, Eigen::Index samples) {
    const Kind kind = fault_.kind;
    plant_.output(y_.data());
    if (kind == Kind::wired_skew) {
      late_.output(y_late_.data());
      if (fault_.of_sensor)
        y_[fault_.a] = y_late_[fault_.a];
      else
        y_ += y_late_;  // the two plants share the actuators
    }
    if (kind == Kind::wired_swap && fault_.of_sensor) std::swap(y_[fault_.a], y_[fault_.b]);
    if (kind == Kind::wired_gain && fault_.of_sensor) y_[fault_.a] *= fault_.value;
    if (kind == Kind::dead_sensor) y_[fault_.a] = 0.0;
    for (double& value : y_) value += request_.stage.simulation.sensor_noise_m * random.normal();
    if (kind == Kind::saturation && fault_.of_sensor)
      y_[fault_.a] = std::clamp(y_[fault_.a], -fault_.value, fault_.value);
    if (kind == Kind::stuck_sensor) {
      if (n < samples / 2) stuck_ = y_[fault_.a];
      y_[fault_.a] = stuck_;
    }
  }

  void push() {
    const Kind kind = fault_.kind;
    force_ = u_;
    if (kind == Kind::wired_swap && !fault_.of_sensor)
      std::swap(force_[fault_.a], force_[fault_.b]);
    if (kind == Kind::wired_gain && !fault_.of_sensor) force_[fault_.a] *= fault_.value;
    if (kind == Kind::wired_skew && !fault_.of_sensor) {
      Eigen::VectorXd one = Eigen::VectorXd::Zero(force_.size());
      std::swap(one[fault_.a], force_[fault_.a]);
      late_.step(one.data());
    } else if (kind == Kind::wired_skew) {
      late_.step(force_.data());
    }
    plant_.step(force_.data());
  }

  const FaultyLogRequest& request_;
  const PlantedFault& fault_;
  ModalPlant plant_;
  ModalPlant late_;
  MotionController controller_;
  Eigen::VectorXd y_;
  Eigen::VectorXd y_late_;
  Eigen::VectorXd u_;
  Eigen::VectorXd force_;
  double window_m_;
  double stuck_ = 0.0;
  double mode_hz_ = 0.0;
  double mode_damping_ = 0.0;
};

FrequencyGrid grid_of(const FaultyLogRequest& request) {
  const double rate_hz = request.stage.info.sample_rate_hz;
  const int period = static_cast<int>(std::lround(request.period_s * rate_hz));
  std::vector<int> lines;
  for (int line = 1; line * rate_hz / period < 0.2 * rate_hz; line += 2) lines.push_back(line);
  return {rate_hz, period, lines};
}

}  // namespace

SimulatedSpec random_wafer_stage(std::uint64_t seed, const SimulatedSpec& nominal) {
  RandomNumbers random(seed);
  SimulatedSpec spec = nominal;
  const auto off = [&](double share) { return 1.0 + random.uniform(-share, share); };
  spec.plant.mass_kg *= off(0.03);
  for (double& inertia : spec.plant.inertia_kg_m2) inertia *= off(0.03);
  for (auto* channels : {&spec.info.actuators, &spec.info.sensors})
    for (Channel& channel : *channels)
      for (int axis = 0; axis < 2; ++axis)
        channel.position_m[axis] -= std::copysign(random.uniform(0.0, 4e-3),
                                                  channel.position_m[axis]);  // stays on the plate
  for (double& frequency_hz : spec.plant.suspension_hz) frequency_hz *= off(0.2);
  spec.plant.first_mode_hz = random.uniform(150.0, 220.0);
  for (double& damping : spec.plant.flexible_damping) damping *= random.uniform(0.7, 2.0);
  spec.info.delay_s *= off(0.05);
  spec.simulation.sensor_noise_m = 1e-9 * std::exp(random.uniform(std::log(0.3), std::log(3.0)));
  return spec;
}

MemoryLog simulate_faulty_log(const FaultyLogRequest& request, const PlantedFault& fault) {
  const FrequencyGrid grid = grid_of(request);
  const Eigen::Index period = grid.samples_per_period();
  const Eigen::Index samples = period * (request.transient_periods + request.periods);
  MemoryLog log;
  log.log_info.sample_rate_hz = grid.sample_rate_hz();
  log.log_info.period_samples = grid.samples_per_period();
  log.log_info.transient_periods = request.transient_periods;
  log.log_info.actuators = list_of(request.configured.info.actuators);
  log.log_info.sensors = list_of(request.configured.info.sensors);
  log.log_info.excitation = log.log_info.actuators;
  const auto n_u = static_cast<Eigen::Index>(log.log_info.actuators.size());
  RandomNumbers seeds(request.seed);
  const auto next_seed = [&] { return static_cast<std::uint64_t>(seeds.integer(0, 1 << 30)); };
  Loop loop(request, fault);
  for (int m = 0; m < request.realizations; ++m)
    for (int axis = 0; axis < request.axes; ++axis) {
      MultisineSpec spec;
      spec.level = request.level_n;
      spec.seed = next_seed();
      Eigen::MatrixXd r = Eigen::MatrixXd::Zero(period, n_u);
      r.col(axis) = random_phase_multisine(grid, spec).samples;
      spec.level = fault.kind == Kind::hidden_excitation ? fault.value : 1.0;
      spec.seed = next_seed();
      const Eigen::VectorXd hidden = random_phase_multisine(grid, spec).samples;
      LogSamples record;
      const double share = 1.0 / (request.realizations * request.axes);
      if (!loop.run(r, hidden, samples, next_seed(), (m * request.axes + axis) * share, share,
                    record))
        return MemoryLog{};
      log.append(m, axis, std::move(r), std::move(record));
    }
  return log;
}

Eigen::VectorXd delayed(const Eigen::VectorXd& x, double delay) {
  Eigen::VectorXd taps(2 * kTaps + 1);
  for (int i = -kTaps; i <= kTaps; ++i) {
    const double t = i - delay;
    const double angle = std::numbers::pi * t;
    const double window = 0.5 + 0.5 * std::cos(angle / (kTaps + 1.0));
    taps[i + kTaps] = window * (std::abs(t) < 1e-12 ? 1.0 : std::sin(angle) / angle);
  }
  Eigen::VectorXd y = Eigen::VectorXd::Zero(x.size());
  for (Eigen::Index n = 0; n < x.size(); ++n)
    for (int i = -kTaps; i <= kTaps; ++i)
      if (n - i >= 0 && n - i < x.size()) y[n] += taps[i + kTaps] * x[n - i];
  return y;
}

void lose_samples(const PlantedFault& fault, Eigen::Index period, Eigen::MatrixXd& x) {
  const Eigen::MatrixXd good = x;
  const auto lost = static_cast<Eigen::Index>(fault.value);
  for (Eigen::Index n = fault.b; n < x.rows(); ++n)
    x.row(n) = good.row(n + lost < x.rows() ? n + lost : n + lost - period);
}

void spoil_recording(const PlantedFault& fault, MemoryLog& log) {
  if (fault.kind == Kind::lost_samples) {
    LogSamples& record = log.records[fault.a];
    lose_samples(fault, log.log_info.period_samples, record.sensors);
    lose_samples(fault, log.log_info.period_samples, record.actuators);
    return;
  }
  if (fault.kind == Kind::late_excitation) {
    for (Eigen::MatrixXd& r : log.excitation_periods) {
      const Eigen::MatrixXd good = r;
      const auto late = static_cast<Eigen::Index>(fault.value);
      for (Eigen::Index n = 0; n < r.rows(); ++n)
        r.row(n) = good.row((n - late + r.rows()) % r.rows());
    }
    return;
  }
  for (LogSamples& record : log.records) {
    Eigen::MatrixXd& x = fault.of_sensor ? record.sensors : record.actuators;
    if (fault.kind == Kind::recorded_swap) x.col(fault.a).swap(x.col(fault.b));
    if (fault.kind == Kind::mapped_excitation) {
      const Eigen::MatrixXd& period = log.excitation_periods[&record - log.records.data()];
      for (Eigen::Index n = 0; n < x.rows(); ++n)
        x(n, fault.a) = period(n % period.rows(), fault.a);
    }
    if (fault.kind == Kind::recorded_gain) x.col(fault.a) *= fault.value;
    if (fault.kind == Kind::recorded_skew)
      x.col(fault.a) = delayed(x.col(fault.a), fault.value * log.log_info.sample_rate_hz);
    if (fault.kind == Kind::saturation)
      x.col(fault.a) = x.col(fault.a).cwiseMax(-fault.value).cwiseMin(fault.value);
  }
}

}  // namespace stageid::test
