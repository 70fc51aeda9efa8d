#include "hal/stage/motion_controller.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "hal/stage/controller_sections.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kLanes = 8;  // one AVX-512 register of doubles, two of AVX2

Eigen::Index padded(Eigen::Index n) { return (n + kLanes - 1) / kLanes * kLanes; }

void check(const MotionControllerSpec& spec) {
  if (!(spec.sample_rate_hz > 0.0) || !std::isfinite(spec.sample_rate_hz))
    throw std::invalid_argument(fmt::format(
        "controller: the sample rate must be positive; got {} Hz", spec.sample_rate_hz));
  const auto axes = static_cast<Eigen::Index>(spec.axes.size());
  if (axes == 0 || spec.sensor_decoupling.rows() != axes ||
      spec.actuator_decoupling.cols() != axes || spec.sensor_decoupling.cols() == 0 ||
      spec.actuator_decoupling.rows() == 0)
    throw std::invalid_argument(
        fmt::format("controller: {} axes need a sensor decoupling with {} rows and an actuator "
                    "decoupling with {} columns; got {} x {} and {} x {}",
                    axes, axes, axes, spec.sensor_decoupling.rows(), spec.sensor_decoupling.cols(),
                    spec.actuator_decoupling.rows(), spec.actuator_decoupling.cols()));
  if (!spec.sensor_decoupling.allFinite() || !spec.actuator_decoupling.allFinite())
    throw std::invalid_argument("controller: a decoupling matrix is not finite");
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
  sensor_decoupling_ = spec.sensor_decoupling;
  actuator_decoupling_ = spec.actuator_decoupling;

  std::vector<std::vector<BiquadSection>> lists;
  for (const AxisController& axis : spec.axes) {
    const bool open = axis.crossover_hz == 0.0;
    lists.push_back(open ? std::vector<BiquadSection>{BiquadSection{.b0 = 0.0}}
                         : controller_sections(axis, spec.sample_rate_hz));
    sections_ = std::max(sections_, static_cast<Eigen::Index>(lists.back().size()));
  }
  const auto axes = static_cast<Eigen::Index>(lists.size());
  const Eigen::Index lanes = padded(axes);
  coefficients_.setZero(lanes, 5 * sections_);
  for (Eigen::Index axis = 0; axis < axes; ++axis) {
    const auto& list = lists[static_cast<std::size_t>(axis)];
    for (Eigen::Index i = 0; i < sections_; ++i) {
      const auto index = static_cast<std::size_t>(i);
      const BiquadSection s = index < list.size() ? list[index] : BiquadSection{};
      coefficients_.row(axis).segment<5>(5 * i) << s.b0, s.b1, s.b2, s.a1, s.a2;
    }
  }
  state_.setZero(lanes, 2 * sections_);
  axis_.setZero(lanes);
  sensor_columns_.setZero(lanes, sensors());
  sensor_columns_.topRows(axes) = sensor_decoupling_.array();
  actuator_columns_.setZero(padded(actuators()), axes);
  actuator_columns_.topRows(actuators()) = -actuator_decoupling_.array();
}

void MotionController::reset() noexcept { state_.setZero(); }

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
  return -(actuator_decoupling_ * axes.asDiagonal() * sensor_decoupling_);
}

}  // namespace stageid
