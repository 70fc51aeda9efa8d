#include "hal/simulator/modal_plant.hpp"

#include <algorithm>
#include <cmath>

#include "excitation/words/require.hpp"
#include "hal/simulator/mode_transition.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kLanes = 8;     // one AVX-512 register of doubles, two of AVX2
constexpr double kLongestDelay = 1e5;  // in samples; limits the memory for held commands

Eigen::Index padded(Eigen::Index n) { return (n + kLanes - 1) / kLanes * kLanes; }

void check(const std::vector<PlantMode>& modes, double delay_s, double sample_rate_hz) {
  require(!modes.empty(), "plant: at least one mode is needed");
  require(sample_rate_hz > 0.0 && std::isfinite(sample_rate_hz),
          "plant: the sample rate must be positive; got {} Hz", sample_rate_hz);
  require(delay_s >= 0.0 && std::isfinite(delay_s), "plant: the delay must be 0 or more; got {} s",
          delay_s);
  require(delay_s * sample_rate_hz <= kLongestDelay,
          "plant: a delay of {} s is {:.0f} samples; the maximum is {:.0f}", delay_s,
          delay_s * sample_rate_hz, kLongestDelay);
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const PlantMode& mode = modes[i];
    require(mode.natural_frequency_hz >= 0.0 && std::isfinite(mode.natural_frequency_hz),
            "plant: mode {}: invalid natural_frequency_hz {}", i + 1, mode.natural_frequency_hz);
    require(mode.damping_ratio >= 0.0 && mode.damping_ratio < 1.0,
            "plant: mode {}: damping_ratio must be in [0, 1); got {}", i + 1, mode.damping_ratio);
    require(mode.acceleration_shape.size() == modes[0].acceleration_shape.size() &&
                mode.actuator_shape.size() == modes[0].actuator_shape.size() &&
                mode.sensor_shape.size() == modes[0].sensor_shape.size(),
            "plant: mode {}: the shapes have a different size than those of mode 1", i + 1);
    require(mode.actuator_shape.allFinite() && mode.sensor_shape.allFinite() &&
                mode.acceleration_shape.allFinite(),
            "plant: mode {}: a shape is not finite", i + 1);
  }
}

}  // namespace

ModalPlant::ModalPlant(const std::vector<PlantMode>& modes, double delay_s, double sample_rate_hz) {
  check(modes, delay_s, sample_rate_hz);
  actuators_ = modes[0].actuator_shape.size();
  sensors_ = modes[0].sensor_shape.size();
  const auto count = static_cast<Eigen::Index>(modes.size());
  modes_ = padded(count);
  period_s_ = 1.0 / sample_rate_hz;
  const double whole = std::floor(delay_s * sample_rate_hz);
  fraction_ = delay_s * sample_rate_hz - whole;

  actuator_shape_.setZero(modes_, actuators_);
  sensor_shape_.setZero(padded(sensors_), modes_);
  step_.setZero(modes_, 8);
  undelayed_.setZero(modes_, 2);
  resistance_.setZero(modes_, 2);
  if (std::any_of(modes.begin(), modes.end(),
                  [](const PlantMode& mode) { return mode.acceleration_shape.size() > 0; }))
    acceleration_shape_.setZero(sensors_, modes_);
  held_.setZero(modes_, static_cast<Eigen::Index>(whole) + 2);
  q_.setZero(modes_);
  v_.setZero(modes_);
  unloaded_.setZero(count);
  for (Eigen::Index i = 0; i < count; ++i) take(i, modes[i]);
}

void ModalPlant::take(Eigen::Index i, const PlantMode& mode) noexcept {
  retune(i, mode.natural_frequency_hz, mode.damping_ratio);
  actuator_shape_.row(i) = mode.actuator_shape.transpose();
  sensor_shape_.col(i).head(sensors_) = mode.sensor_shape;
  if (mode.acceleration_shape.size() > 0) acceleration_shape_.col(i) = mode.acceleration_shape;
}

void ModalPlant::reload(const LoadedModes& from, const LoadedModes& to) noexcept {
  const Eigen::Index n = unloaded_.size();
  for (Eigen::ArrayXd* motion : {&q_, &v_}) {
    unloaded_.noalias() = from.basis * motion->head(n).matrix();
    motion->head(n).matrix().noalias() = to.inverse * unloaded_;
  }
  for (Eigen::Index c = 0; c < held_.cols(); ++c) {
    unloaded_.noalias() = from.inverse.transpose() * held_.col(c).head(n).matrix();
    held_.col(c).head(n).matrix().noalias() = to.basis.transpose() * unloaded_;
  }
  for (Eigen::Index i = 0; i < n; ++i) take(i, to.modes[i]);
}

void ModalPlant::retune(Eigen::Index mode, double natural_frequency_hz,
                        double damping_ratio) noexcept {
  const double omega = kTwoPi * natural_frequency_hz;
  const auto over = [&](double part) {
    return mode_transition(omega, damping_ratio, part * period_s_);
  };
  const ModeTransition all = over(1.0);
  const ModeTransition late = over(1.0 - fraction_);
  const Eigen::Vector2d of_old = late.transition * over(fraction_).input;
  const Eigen::Matrix2d& e = all.transition;
  step_.row(mode) << e(0, 0), e(0, 1), e(1, 0), e(1, 1), of_old[0], of_old[1], late.input[0],
      late.input[1];
  undelayed_.row(mode) << all.input[0], all.input[1];
  resistance_.row(mode) << omega * omega, 2.0 * damping_ratio * omega;
}

void ModalPlant::reset() noexcept {
  held_.setZero();
  q_.setZero();
  v_.setZero();
  newest_ = 0;
  extra_mode_ = last_extra_mode_ = -1;
}

void ModalPlant::modal_force(const double* u, double* __restrict__ force) const noexcept {
  for (Eigen::Index block = 0; block < modes_; block += kLanes) {
    double sum[kLanes] = {};
    const double* shape = actuator_shape_.data() + block;
    for (Eigen::Index j = 0; j < actuators_; ++j, shape += modes_)
      for (Eigen::Index lane = 0; lane < kLanes; ++lane) sum[lane] += u[j] * shape[lane];
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) force[block + lane] = sum[lane];
  }
}

void ModalPlant::step(const double* u) noexcept {
  // held_ has d + 2 columns. With u[n] in column `newest_`, u[n-d] is d columns back, which is two ahead in the
  // ring; u[n-d-1] is one ahead.
  const Eigen::Index columns = held_.cols();
  newest_ = newest_ + 1 == columns ? 0 : newest_ + 1;
  modal_force(u, held_.data() + newest_ * modes_);
  const Eigen::Index older = newest_ + 1 == columns ? 0 : newest_ + 1;
  const Eigen::Index newer = older + 1 == columns ? 0 : older + 1;
  const double* old_force = held_.data() + older * modes_;
  const double* new_force = held_.data() + newer * modes_;
  const double* c = step_.data();
  double* __restrict__ q = q_.data();
  double* __restrict__ v = v_.data();
  const Eigen::Index n = modes_;
  for (Eigen::Index block = 0; block < n; block += kLanes) {
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
      const Eigen::Index i = block + lane;
      const double q_next =
          c[i] * q[i] + c[n + i] * v[i] + c[4 * n + i] * old_force[i] + c[6 * n + i] * new_force[i];
      const double v_next = c[2 * n + i] * q[i] + c[3 * n + i] * v[i] +
                            c[5 * n + i] * old_force[i] + c[7 * n + i] * new_force[i];
      q[i] = q_next;
      v[i] = v_next;
    }
  }
  last_extra_mode_ = extra_mode_;
  if (extra_mode_ >= 0) {
    q[extra_mode_] += undelayed_(extra_mode_, 0) * extra_force_;
    v[extra_mode_] += undelayed_(extra_mode_, 1) * extra_force_;
    extra_mode_ = -1;
  }
}

void ModalPlant::output(double* y) const noexcept {
  const Eigen::Index rows = sensor_shape_.rows();
  for (Eigen::Index block = 0; block < rows; block += kLanes) {
    // Four partial sums shorten the chain of dependent additions.
    double sum[4][kLanes] = {};
    const double* shape = sensor_shape_.data() + block;
    for (Eigen::Index i = 0; i < modes_; i += 4)
      for (Eigen::Index part = 0; part < 4; ++part, shape += rows)
        for (Eigen::Index lane = 0; lane < kLanes; ++lane)
          sum[part][lane] += q_[i + part] * shape[lane];
    const Eigen::Index used = std::min(kLanes, sensors_ - block);
    double total[kLanes];
    for (Eigen::Index lane = 0; lane < kLanes; ++lane)
      total[lane] = (sum[0][lane] + sum[1][lane]) + (sum[2][lane] + sum[3][lane]);
    for (Eigen::Index lane = 0; lane < used; ++lane) y[block + lane] = total[lane];
  }
  if (acceleration_shape_.size() > 0) add_accelerations(y);
}

/// Just before this instant, under the command that acted last.
void ModalPlant::add_accelerations(double* y) const noexcept {
  const Eigen::Index acting = (newest_ + 2) % held_.cols();
  for (Eigen::Index i = 0; i < modes_; ++i) {
    double a = held_(i, acting) - resistance_(i, 0) * q_[i] - resistance_(i, 1) * v_[i];
    if (i == last_extra_mode_) a += extra_force_;
    for (Eigen::Index s = 0; s < sensors_; ++s) y[s] += acceleration_shape_(s, i) * a;
  }
}

}  // namespace stageid
