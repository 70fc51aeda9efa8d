#include "hal/stage/motion_controller.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "excitation/decompositions/decompositions.hpp"
#include "excitation/words/require.hpp"
#include "hal/stage/controller_sections.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kLanes = 8;  // one AVX-512 register of doubles, two of AVX2

Eigen::Index padded(Eigen::Index n) { return (n + kLanes - 1) / kLanes * kLanes; }

void check(const MotionControllerSpec& spec) {
  require(spec.sample_rate_hz > 0.0 && std::isfinite(spec.sample_rate_hz),
          "controller: the sample rate must be positive; got {} Hz", spec.sample_rate_hz);
  const auto axes = static_cast<Eigen::Index>(spec.axes.size());
  const Eigen::Index sensors = spec.sensor_decoupling.cols();
  const Eigen::Index actuators = spec.actuator_decoupling.rows();
  require(spec.sensor_decoupling.rows() == axes && spec.actuator_decoupling.cols() == axes &&
              sensors != 0 && actuators != 0,
          "controller: {} axes need a sensor decoupling with {} rows and an actuator decoupling "
          "with {} columns; got {} x {} and {} x {}",
          axes, axes, axes, spec.sensor_decoupling.rows(), sensors, actuators,
          spec.actuator_decoupling.cols());
  require(spec.sensor_decoupling.allFinite() && spec.actuator_decoupling.allFinite(),
          "controller: a decoupling matrix is not finite");
  for (const ControllerTransfer& t : spec.transfer)
    require(
        t.actuator >= 0 && t.actuator < actuators && t.sensor >= 0 && t.sensor < sensors,
        "controller: a transfer function from sensor {} to actuator {}, but there are {} and {}",
        t.sensor + 1, t.actuator + 1, sensors, actuators);
  require(spec.feed_forward_n.size() == 0 || spec.feed_forward_n.size() == actuators,
          "controller: the feed-forward has {} values for {} actuators", spec.feed_forward_n.size(),
          actuators);
  require(spec.feed_forward_n.allFinite() && spec.feed_forward_ramp_s >= 0.0 &&
              std::isfinite(spec.feed_forward_ramp_s),
          "controller: feed-forward and its ramp must be finite, the ramp not negative");
}

void check(const ControllerStateSpace& s, Eigen::Index actuators, Eigen::Index sensors) {
  const Eigen::Index n = s.a.rows();
  const auto check_matrix = [](const char* name, const Eigen::MatrixXd& m, Eigen::Index rows,
                               Eigen::Index columns) {
    require(m.rows() == rows && m.cols() == columns,
            "controller: matrix {} is {} x {}; expected {} x {}", name, m.rows(), m.cols(), rows,
            columns);
    require(m.allFinite(), "controller: matrix {} has an entry that is not finite", name);
  };
  check_matrix("A", s.a, n, n);
  check_matrix("B", s.b, n, sensors);
  check_matrix("C", s.c, actuators, n);
  check_matrix("D", s.d, actuators, sensors);
}

// y = M x, with the columns of M padded to `rows`, a multiple of the lane width.
template <typename Store>
inline void multiply(const Eigen::ArrayXXd& columns, Eigen::Index count, const double* x,
                     Store store) {
  const Eigen::Index rows = columns.rows();
  for (Eigen::Index block = 0; block < rows; block += kLanes) {
    double sum[kLanes] = {};
    const double* column = columns.data() + block;
    for (Eigen::Index j = 0; j < count; ++j, column += rows)
      for (Eigen::Index lane = 0; lane < kLanes; ++lane) sum[lane] += x[j] * column[lane];
    store(block, sum);
  }
}

}  // namespace

MotionController::MotionController(const MotionControllerSpec& spec) {
  check(spec);
  sample_rate_hz_ = spec.sample_rate_hz;
  add_sections(spec);
  if (!spec.state_space.empty()) add_state_space(spec.state_space);
  if (spec.feed_forward_n.size() > 0 && !spec.feed_forward_n.isZero(0.0)) {
    feed_forward_ = spec.feed_forward_n.array();
    ramp_samples_ =
        static_cast<std::uint64_t>(std::llround(spec.feed_forward_ramp_s * spec.sample_rate_hz)) +
        1;
  }
}

void MotionController::add_sections(const MotionControllerSpec& spec) {
  const auto axes = static_cast<Eigen::Index>(spec.axes.size());
  const Eigen::Index count = axes + static_cast<Eigen::Index>(spec.transfer.size());
  sensor_decoupling_.setZero(count, spec.sensor_decoupling.cols());
  actuator_decoupling_.setZero(spec.actuator_decoupling.rows(), count);
  sensor_decoupling_.topRows(axes) = spec.sensor_decoupling;
  actuator_decoupling_.leftCols(axes) = spec.actuator_decoupling;

  std::vector<std::vector<BiquadSection>> lists;
  for (const AxisController& axis : spec.axes) {
    const bool open = axis.crossover_hz == 0.0;
    lists.push_back(open ? std::vector<BiquadSection>{BiquadSection{.b0 = 0.0}}
                         : controller_sections(axis, spec.sample_rate_hz));
  }
  for (const ControllerTransfer& transfer : spec.transfer) {
    const auto lane = static_cast<Eigen::Index>(lists.size());
    sensor_decoupling_(lane, transfer.sensor) = 1.0;
    actuator_decoupling_(transfer.actuator, lane) = 1.0;
    lists.push_back(transfer_sections(transfer));
  }
  for (const std::vector<BiquadSection>& list : lists)
    sections_ = std::max(sections_, static_cast<Eigen::Index>(list.size()));
  const Eigen::Index lanes = padded(count);
  coefficients_.setZero(lanes, 5 * sections_);
  for (Eigen::Index lane = 0; lane < count; ++lane) {
    const auto& list = lists[lane];
    for (Eigen::Index i = 0; i < sections_; ++i) {
      const auto index = static_cast<std::size_t>(i);
      const BiquadSection s = index < list.size() ? list[index] : BiquadSection{};
      coefficients_.row(lane).segment<5>(5 * i) << s.b0, s.b1, s.b2, s.a1, s.a2;
    }
  }
  state_.setZero(lanes, 2 * sections_);
  axis_.setZero(lanes);
  sensor_columns_.setZero(lanes, sensors());
  sensor_columns_.topRows(count) = sensor_decoupling_.array();
  actuator_columns_.setZero(padded(actuators()), count);
  actuator_columns_.topRows(actuators()) = -actuator_decoupling_.array();
}

void MotionController::add_state_space(const ControllerStateSpace& given) {
  check(given, actuators(), sensors());
  state_space_ = given;
  const Eigen::Index n = given.a.rows();
  system_columns_.setZero(padded(n + actuators()), n + sensors());
  Eigen::MatrixXd system(n + actuators(), n + sensors());
  system << given.a, given.b, -given.c, -given.d;
  system_columns_.topRows(system.rows()) = system.array();
  system_input_.setZero(n + sensors());
  system_output_.setZero(system_columns_.rows());
}

void MotionController::reset() noexcept {
  state_.setZero();
  system_input_.setZero();
  ramp_done_ = 0;
}

void MotionController::update(const double* y, double* u) noexcept {
  const Eigen::Index lanes = axis_.size();
  multiply(sensor_columns_, sensors(), y, [&](Eigen::Index block, const double* position) {
    double x[kLanes];
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) x[lane] = position[lane];
    for (Eigen::Index section = 0; section < sections_; ++section) {
      const double* c = coefficients_.data() + 5 * section * lanes + block;
      double* s1 = state_.data() + 2 * section * lanes + block;
      double* s2 = s1 + lanes;
      double out[kLanes];
      double next1[kLanes];
      double next2[kLanes];
      for (Eigen::Index i = 0; i < kLanes; ++i) {  // direct form II transposed
        out[i] = c[i] * x[i] + s1[i];
        next1[i] = c[lanes + i] * x[i] - c[3 * lanes + i] * out[i] + s2[i];
        next2[i] = c[2 * lanes + i] * x[i] - c[4 * lanes + i] * out[i];
      }
      for (Eigen::Index i = 0; i < kLanes; ++i) {
        s1[i] = next1[i];
        s2[i] = next2[i];
        x[i] = out[i];
      }
    }
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) axis_[block + lane] = x[lane];
  });
  const Eigen::Index count = actuators();
  multiply(actuator_columns_, actuator_columns_.cols(), axis_.data(),
           [&](Eigen::Index block, const double* force) {
             const Eigen::Index used = std::min(kLanes, count - block);
             for (Eigen::Index lane = 0; lane < used; ++lane) u[block + lane] = force[lane];
           });
  if (system_columns_.size() > 0) update_state_space(y, u);
  if (feed_forward_.size() > 0) add_feed_forward(u);
}

void MotionController::update_state_space(const double* y, double* u) noexcept {
  const Eigen::Index n = state_space_.a.rows();
  std::copy(y, y + sensors(), system_input_.data() + n);
  multiply(system_columns_, system_columns_.cols(), system_input_.data(),
           [this](Eigen::Index block, const double* value) {
             for (Eigen::Index lane = 0; lane < kLanes; ++lane)
               system_output_[block + lane] = value[lane];
           });
  std::copy(system_output_.data(), system_output_.data() + n, system_input_.data());
  for (Eigen::Index i = 0; i < actuators(); ++i) u[i] += system_output_[n + i];
}

void MotionController::add_feed_forward(double* u) noexcept {
  ramp_done_ = std::min(ramp_done_ + 1, ramp_samples_);
  const double share = static_cast<double>(ramp_done_) / static_cast<double>(ramp_samples_);
  for (Eigen::Index i = 0; i < actuators(); ++i) u[i] += share * feed_forward_[i];
}

bool MotionController::lane_acts(Eigen::Index lane) const noexcept {
  for (Eigen::Index i = 0; i < sections_; ++i)
    if ((coefficients_.row(lane).segment<3>(5 * i) == 0.0).all()) return false;
  return true;
}

bool MotionController::acts() const noexcept {
  for (Eigen::Index lane = 0; lane < sensor_decoupling_.rows(); ++lane)
    if (lane_acts(lane)) return true;
  return !state_space_.c.isZero(0.0) || !state_space_.d.isZero(0.0);
}

Eigen::MatrixXcd MotionController::response(double frequency_hz) const {
  const std::complex<double> z_inverse =
      std::polar(1.0, -2.0 * std::numbers::pi * frequency_hz / sample_rate_hz_);
  Eigen::VectorXcd axes(sensor_decoupling_.rows());
  for (Eigen::Index axis = 0; axis < axes.size(); ++axis) {
    std::complex<double> value = 1.0;
    for (Eigen::Index i = 0; i < sections_; ++i) {
      const auto c = coefficients_.row(axis).segment<5>(5 * i);
      value *= BiquadSection{c[0], c[1], c[2], c[3], c[4]}.response(z_inverse);
    }
    axes[axis] = value;
  }
  Eigen::MatrixXcd response = -(actuator_decoupling_ * axes.asDiagonal() * sensor_decoupling_);
  if (state_space_.empty()) return response;
  response -= state_space_.d;
  const Eigen::Index n = state_space_.a.rows();
  if (n == 0) return response;
  const Eigen::MatrixXcd M = Eigen::MatrixXcd::Identity(n, n) / z_inverse - state_space_.a;
  return response - state_space_.c * solve(M, state_space_.b.cast<std::complex<double>>());
}

ControllerStateSpace MotionController::realization() const {
  MotionController probe = *this;
  probe.feed_forward_.resize(0);
  std::vector<double*> states;
  const Eigen::Index lanes = coefficients_.rows();
  for (Eigen::Index lane = 0; lane < sensor_decoupling_.rows(); ++lane)
    for (Eigen::Index i = 0; lane_acts(lane) && i < sections_; ++i) {
      if ((coefficients_.row(lane).segment<4>(5 * i + 1) == 0.0).all()) continue;
      states.push_back(probe.state_.data() + 2 * i * lanes + lane);
      states.push_back(states.back() + lanes);
    }
  for (Eigen::Index i = 0; i < state_space_.a.rows(); ++i)
    states.push_back(probe.system_input_.data() + i);

  const auto n = static_cast<Eigen::Index>(states.size());
  ControllerStateSpace out{{n, n}, {n, sensors()}, {actuators(), n}, {actuators(), sensors()}};
  Eigen::VectorXd y = Eigen::VectorXd::Zero(sensors());
  Eigen::VectorXd u(actuators());
  const auto step = [&](auto next, auto output) {
    probe.update(y.data(), u.data());
    for (Eigen::Index i = 0; i < n; ++i) next[i] = *states[i];
    output = -u;
  };
  for (Eigen::Index i = 0; i < n; ++i) {
    probe.reset();
    *states[i] = 1.0;
    step(out.a.col(i), out.c.col(i));
  }
  for (Eigen::Index i = 0; i < sensors(); ++i) {
    probe.reset();
    y = Eigen::VectorXd::Unit(sensors(), i);
    step(out.b.col(i), out.d.col(i));
  }
  return out;
}

}  // namespace stageid
