#include "hal/stage/limit_guard.hpp"

#include <algorithm>
#include <cmath>

#include "excitation/words/require.hpp"

namespace stageid {
namespace {

constexpr double kObserverPoles = 1.0 / 3.0;  // of the loop's bandwidth
constexpr double kBrakeObserverPoles = 3.0;
constexpr double kBrakeRate = 2.0;
constexpr double kLargestBrakeRate = 4.0;
constexpr double kBrakeTimeConstants = 5.0;  // of the loop
constexpr double kForceForStopping = 0.5;    // of all actuators; the rest is for other axes
constexpr double kBlindPoles = 0.05;     // of the sample rate, if the loop's bandwidth is unknown
constexpr double kLeastResponse = 0.25;  // a stage with a smaller response cannot be braked
constexpr double kErrorThatTells = 0.1;  // of deviation_m: if less, the response is as expected

}  // namespace

LimitGuard::LimitGuard(const StageLimits& limits, const StageInfo& info)
    : limits_(complete_limits(limits, info)), period_s_(1.0 / info.sample_rate_hz) {
  const auto sensors = static_cast<Eigen::Index>(info.sensors.size());
  const RigidMotion& motion = limits_.motion;
  repeats_allowed_ =
      static_cast<std::uint32_t>(std::llround(limits_.stuck_sensor_s * info.sample_rate_hz));

  stopping_s2_m_.setZero(sensors);
  double pole_rad_s = kBlindPoles * info.sample_rate_hz;
  Eigen::Index delay_samples = 0;
  if (motion.known()) {
    pole_rad_s = kObserverPoles * motion.bandwidth_rad_s;
    const Eigen::ArrayXd a =
        kForceForStopping * (motion.acceleration_per_n.cwiseAbs() * limits_.actuator_n).array();
    // Without limits, 0 times infinity is NaN, which is not positive either.
    stopping_s2_m_ = (a > 0.0).select(0.5 / a, 0.0);
    brake_gains_ =
        observer_gains(kBrakeObserverPoles * motion.bandwidth_rad_s, info.sample_rate_hz);
    brake_samples_ = static_cast<std::uint64_t>(
        std::ceil(kBrakeTimeConstants / motion.bandwidth_rad_s * info.sample_rate_hz));
    const double delay = info.delay_s * info.sample_rate_hz;
    delay_samples = static_cast<Eigen::Index>(std::floor(delay));
    late_fraction_ = delay - std::floor(delay);
  }
  const Eigen::ArrayXd middle_m = 0.5 * (limits_.position_window_m + limits_.hard_window_m);
  room_m_ = (stopping_s2_m_ > 0.0).select(middle_m, kUnlimited);
  gains_ = observer_gains(pole_rad_s, info.sample_rate_hz);
  forget_ = std::exp(-pole_rad_s / info.sample_rate_hz);
  weight_m2_ = (1.0 - forget_) / limits_.deviation_m.array().square();

  accelerations_.setZero(sensors, delay_samples + 2);
  acting_.setZero(sensors);
  force_.setZero(limits_.actuator_n.size());
  wanted_acceleration_.setZero(sensors);
  measured_.setZero(sensors);
  contradicting_.setZero(sensors);
  contradicting_at_start_.setZero(sensors);
  p_.setZero(sensors);
  for (Eigen::ArrayXd* state :
       {&v_, &d_, &force_p_, &force_v_, &force_d_, &last_error_m_, &last_y_})
    *state = p_;
  repeats_.setZero(sensors);
  believed_.setConstant(sensors, true);
  moves_.resize(sensors);
  for (Eigen::Index i = 0; i < sensors; ++i) moves_[i] = !is_acceleration(info.sensors[i]);
}

/// Three equal poles of a constant-acceleration observer (a g-h-k filter, critically damped).
LimitGuard::Gains LimitGuard::observer_gains(double pole_rad_s, double rate_hz) noexcept {
  const double pole = std::exp(-pole_rad_s / rate_hz);
  const double rest = 1.0 - pole;
  return {1.0 - pole * pole * pole, 1.5 * rest * rest * (1.0 + pole) * rate_hz,
          rest * rest * rest * rate_hz * rate_hz};
}

void LimitGuard::carry(const Eigen::VectorXd& load, std::uint64_t ramp_samples) {
  if (load.size() == 0 || ramp_samples == 0 || !limits_.motion.known()) return;
  require(load.size() == force_.size(), "limits: load has {} entries for {} channels", load.size(),
          force_.size());
  load_ = load;
  load_samples_ = ramp_samples;
}

void LimitGuard::start(const Inputs& first) noexcept {
  carried_samples_ = 0;
  for (Eigen::Index i = 0; i < p_.size(); ++i) {
    const double y = first.y[i];
    p_[i] = std::isfinite(y) ? y : 0.0;
  }
  measured_ = p_.matrix();
  if (limits_.motion.contradiction.size() > 0)
    contradicting_at_start_.noalias() = limits_.motion.contradiction * measured_;
  for (Eigen::ArrayXd* state : {&v_, &d_, &force_p_, &force_v_, &force_d_, &last_error_m_})
    state->setZero();
  last_y_.setConstant(std::numeric_limits<double>::quiet_NaN());  // compares unequal to any value
  accelerations_.setZero();
  repeats_.setZero();
  believed_.setConstant(true);
  sensor_failed_ = open_ = false;
  error_by_force_ = force_by_force_ = 0.0;
  response_ = force_scale_ = 1.0;
  brake_samples_left_ = 0;
}

void LimitGuard::predict(const Eigen::ArrayXd& u) noexcept {
  if (limits_.motion.known()) find_acceleration(u);
  const double t = period_s_;
  for (Eigen::Index i = 0; i < p_.size(); ++i) {
    const double a = acting_[i] * force_scale_;
    p_[i] += t * (v_[i] + 0.5 * t * (a + d_[i]));
    v_[i] += t * (a + d_[i]);
    if (open_) continue;
    force_p_[i] += t * (force_v_[i] + 0.5 * t * (a + force_d_[i]));
    force_v_[i] += t * (a + force_d_[i]);
  }
}

/// Acceleration by the commands that act in this interval, which are delayed by a fractional number of samples.
void LimitGuard::find_acceleration(const Eigen::ArrayXd& u) noexcept {
  force_ = u.matrix();
  if (load_.size() > 0) {
    carried_samples_ = std::min(carried_samples_ + 1, load_samples_);
    force_ -= carried_share() * load_;
  }
  newest_ = newest_ + 1 == accelerations_.cols() ? 0 : newest_ + 1;
  acting_.noalias() = limits_.motion.acceleration_per_n * force_;
  accelerations_.col(newest_) = acting_.array();
  // The ring has d + 2 columns: the newest is followed by the oldest, u[n-d-1], and by u[n-d].
  const Eigen::Index oldest = newest_ + 1 == accelerations_.cols() ? 0 : newest_ + 1;
  const Eigen::Index next = oldest + 1 == accelerations_.cols() ? 0 : oldest + 1;
  acting_ = late_fraction_ * accelerations_.col(oldest).matrix() +
            (1.0 - late_fraction_) * accelerations_.col(next).matrix();
}

LimitGuard::Finding LimitGuard::inspect(Inputs& inputs) noexcept {
  Finding finding;
  error_by_force_ *= forget_;
  force_by_force_ *= forget_;
  for (Eigen::Index i = 0; i < p_.size(); ++i) {
    double& y = inputs.y[i];
    const std::uint64_t bit = std::uint64_t{1} << i;
    if (!std::isfinite(y)) {
      finding.add(sensor_failure(i, LimitKind::not_finite, y, 0.0, inputs.cycle), false);
      inputs.valid &= ~bit;
      y = std::isfinite(last_y_[i]) ? last_y_[i] : 0.0;
    } else {
      if (believed_[i] && (inputs.valid & bit) != 0) judge_motion(i, y, inputs.cycle, finding);
      if (believed_[i]) judge_place(i, y, inputs.cycle, finding);
    }
    last_y_[i] = y;
  }
  if (limits_.motion.contradiction.size() > 0 && !sensor_failed_) compare_sensors(inputs, finding);
  if (!open_)
    response_ = 1.0 - error_by_force_ / (force_by_force_ + kErrorThatTells * kErrorThatTells);
  return finding;
}

/// Checks whether the forces explain the measurement.
void LimitGuard::judge_motion(Eigen::Index i, double y, std::uint64_t cycle,
                              Finding& finding) noexcept {
  const double error = y - p_[i];
  const bool far = std::abs(error) > limits_.deviation_m[i];
  const bool was_near = std::abs(last_error_m_[i]) < 0.5 * limits_.deviation_m[i];
  last_error_m_[i] = error;
  if (repeats_allowed_ > 0 && y == last_y_[i]) {
    ++repeats_[i];  // no new information: predict without correction
    if (far || repeats_[i] >= repeats_allowed_)
      finding.add(sensor_failure(i, LimitKind::stuck_sensor, y, repeats_[i] * period_s_, cycle),
                  false);
    return;
  }
  repeats_[i] = 0;
  if (far && !open_) {
    if (was_near) {
      finding.add(sensor_failure(i, LimitKind::sensor_jump, error, limits_.deviation_m[i], cycle),
                  false);
      return;
    }
    finding.add(violation(LimitKind::deviation, i, error, limits_.deviation_m[i], cycle), false);
  }
  correct(i, error);
}

/// Checks whether all sensors measure one rigid motion.
void LimitGuard::compare_sensors(const Inputs& inputs, Finding& finding) noexcept {
  const std::uint64_t all = all_bits(static_cast<std::size_t>(p_.size()));
  if ((inputs.valid & all) != all) return;
  measured_ = last_y_.matrix();
  contradicting_.noalias() = limits_.motion.contradiction * measured_;
  for (Eigen::Index i = 0; i < p_.size(); ++i) {
    const double difference = contradicting_[i] - contradicting_at_start_[i];
    if (!(std::abs(difference) > limits_.deviation_m[i])) continue;
    sensor_failed_ = true;  // it is unknown which one
    finding.add(
        violation(LimitKind::contradiction, i, difference, limits_.deviation_m[i], inputs.cycle),
        false);
    return;
  }
}

/// Checks whether there is enough room to stop.
void LimitGuard::judge_place(Eigen::Index i, double y, std::uint64_t cycle,
                             Finding& finding) noexcept {
  const double v = speed(i);
  const double rest_m = y + v * std::abs(v) * stopping_s2_m_[i];
  if (std::abs(y) > limits_.hard_window_m[i])
    finding.add(violation(LimitKind::hard_position, i, y, limits_.hard_window_m[i], cycle), false);
  else if (std::abs(v) > limits_.speed_m_s[i])
    finding.add(violation(LimitKind::speed, i, v, limits_.speed_m_s[i], cycle), false);
  else if (std::abs(rest_m) > room_m_[i])
    finding.add(violation(LimitKind::stopping_distance, i, rest_m, room_m_[i], cycle), false);
  if (std::abs(y) > limits_.position_window_m[i])
    finding.add(violation(LimitKind::position, i, y, limits_.position_window_m[i], cycle), true);
}

LimitViolation LimitGuard::sensor_failure(Eigen::Index i, LimitKind kind, double value,
                                          double limit, std::uint64_t cycle) noexcept {
  believed_[i] = false;
  sensor_failed_ = true;
  return violation(kind, i, value, limit, cycle);
}

void LimitGuard::correct(Eigen::Index i, double error) noexcept {
  const Gains& k = open_ ? brake_gains_ : gains_;
  p_[i] += k.position * error;
  v_[i] += k.speed_hz * error;
  d_[i] += k.acceleration_hz2 * error;
  if (open_) return;
  const double force_error = -force_p_[i];
  force_p_[i] += k.position * force_error;
  force_v_[i] += k.speed_hz * force_error;
  force_d_[i] += k.acceleration_hz2 * force_error;
  error_by_force_ += weight_m2_[i] * error * force_error;
  force_by_force_ += weight_m2_[i] * force_error * force_error;
}

bool LimitGuard::begin_brake() noexcept {
  open_ = true;
  if (!sensor_failed_) {
    p_ += (response_ - 1.0) * force_p_;
    v_ += (response_ - 1.0) * force_v_;
    d_ += (response_ - 1.0) * force_d_;
    force_scale_ = response_;
  }
  brake_divisor_ = std::copysign(std::max(1.0, std::abs(force_scale_)), force_scale_);
  if (limits_.motion.force_per_acceleration.size() == 0 || std::abs(force_scale_) < kLeastResponse)
    return false;
  choose_brake_rate();
  brake_samples_left_ = brake_samples_;
  return true;
}

// With a force proportional to the speed v, a brake of rate w needs the distance v / w.
void LimitGuard::choose_brake_rate() noexcept {
  double needed_rad_s = kBrakeRate * limits_.motion.bandwidth_rad_s;
  for (Eigen::Index i = 0; i < p_.size(); ++i) {
    const double room_m = room_m_[i] - std::abs(p_[i]);
    if (p_[i] * v_[i] > 0.0)
      needed_rad_s = std::max(needed_rad_s, std::abs(v_[i]) / std::max(room_m, 0.0));
  }
  brake_rate_rad_s_ = std::min(needed_rad_s, kLargestBrakeRate * limits_.motion.bandwidth_rad_s);
}

void LimitGuard::brake(Eigen::ArrayXd& u) noexcept {
  wanted_acceleration_ = -(brake_rate_rad_s_ * v_ + d_).matrix() / brake_divisor_;
  force_.noalias() = limits_.motion.force_per_acceleration * wanted_acceleration_;
  if (load_.size() > 0) force_ += carried_share() * load_;
  u = force_.array();
  --brake_samples_left_;
}

double LimitGuard::speed_m_s() const noexcept {
  double largest = 0.0;
  for (Eigen::Index i = 0; i < v_.size(); ++i)
    if (moves_[i]) largest = std::max(largest, std::abs(speed(i)));
  return largest;
}

}  // namespace stageid
