#include "hal/simulator/loop_stability.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "excitation/decompositions/decompositions.hpp"
#include "hal/simulator/mode_transition.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Limits the computation to some seconds.
constexpr Index kMostStates = 1000;

/// The directions in which a matrix has entries: m = scale * directions * directions^T / scale * m, with as few columns
/// as its rank.
struct Range {
  VectorXd scale;       // of the rows, which may have different units
  MatrixXd directions;  // orthonormal columns
};

Range range_of(const MatrixXd& m) {
  constexpr double kRankThreshold = 1e-10;
  Range out;
  out.scale = m.cwiseAbs().rowwise().maxCoeff();
  out.scale = (out.scale.array() > 0.0).select(out.scale, 1.0);
  MatrixXd scaled = out.scale.cwiseInverse().asDiagonal() * m;
  for (Index i = 0; i < scaled.cols(); ++i) {
    const double size = scaled.col(i).norm();
    if (size > 0.0) scaled.col(i) /= size;
  }
  Eigen::ColPivHouseholderQR<MatrixXd> qr = pivoted_qr(scaled);
  qr.setThreshold(kRankThreshold);
  out.directions = leading_columns(qr, m.isZero(0.0) ? 0 : qr.rank());
  return out;
}

/// A mode as the controller excites it; state [q, q' / omega_scale].
struct LoopMode {
  VectorXd drive;          // by the directions of the commands
  VectorXd seen;           // sensors
  VectorXd accelerations;  // sensors, or empty
  double omega = 0.0;
  double damping_ratio = 0.0;
  double measured = 0.0;
  Eigen::Matrix2d transition;
  Eigen::Vector2d of_old, of_new;
};

/// The linear map from one sample of the unexcited loop to the next.
class SampledLoop {
 public:
  SampledLoop(const StageInfo& info, const std::vector<PlantMode>& modes,
              ControllerStateSpace controller)
      : controller_(std::move(controller)) {
    const double period_s = 1.0 / info.sample_rate_hz;
    const double whole = std::floor(info.delay_s / period_s);
    fraction_ = info.delay_s / period_s - whole;
    held_ = static_cast<Index>(whole) + 1;
    const ControllerStateSpace& k = controller_;
    MatrixXd outputs(k.d.rows(), k.a.cols() + k.d.cols());
    outputs << k.c, k.d;
    MatrixXd inputs(k.d.cols(), k.a.rows() + k.d.rows());
    inputs << k.b.transpose(), k.d.transpose();
    commands_ = range_of(outputs);
    add_modes(modes, range_of(inputs), period_s);
  }

  Index states() const {
    return 2 * static_cast<Index>(modes_.size()) + held_ * commands() + controller_.a.rows();
  }

  MatrixXd matrix() const {
    MatrixXd a(states(), states());
    for (Index i = 0; i < states(); ++i) a.col(i) = step(VectorXd::Unit(states(), i));
    return a;
  }

 private:
  Index commands() const { return commands_.directions.cols(); }

  void add_modes(const std::vector<PlantMode>& modes, const Range& measured, double period_s) {
    double strongest = 0.0;
    for (const PlantMode& mode : modes) {
      LoopMode m;
      m.drive =
          commands_.directions.transpose() * commands_.scale.asDiagonal() * mode.actuator_shape;
      m.seen = mode.sensor_shape;
      m.accelerations = mode.acceleration_shape;
      m.omega = kTwoPi * mode.natural_frequency_hz;
      m.damping_ratio = mode.damping_ratio;
      VectorXd shape = mode.sensor_shape;
      if (m.accelerations.size() > 0) shape += m.accelerations;
      m.measured = (measured.directions.transpose() * measured.scale.asDiagonal() * shape).norm();
      const auto over = [&](double part) {
        return mode_transition(m.omega, mode.damping_ratio, part * period_s);
      };
      m.transition = over(1.0).transition;
      m.of_old = over(1.0 - fraction_).transition * over(fraction_).input;
      m.of_new = over(1.0 - fraction_).input;
      strongest = std::max(strongest, m.drive.norm() * m.measured);
      modes_.push_back(std::move(m));
    }
    std::erase_if(modes_, [&](const LoopMode& m) {
      return m.drive.norm() * m.measured <= 1e-12 * strongest;
    });
  }

  VectorXd step(const VectorXd& x) const {
    VectorXd next(x.size());
    const Index n = commands();
    const Index count = static_cast<Index>(modes_.size());
    const Index first_held = 2 * count;
    VectorXd y = VectorXd::Zero(controller_.d.cols());
    // Held commands, newest first: u[n-1] ... u[n-d-1].
    const VectorXd of_old = x.segment(first_held + n * (held_ - 1), n);
    for (Index i = 0; i < count; ++i) {
      const LoopMode& m = modes_[i];
      y += m.seen * x[2 * i];
      if (m.accelerations.size() > 0)
        y += m.accelerations * (m.drive.dot(of_old) - m.omega * m.omega * x[2 * i] -
                                2.0 * m.damping_ratio * m.omega * x[2 * i + 1]);
    }
    const auto states = x.tail(controller_.a.rows());
    next.tail(controller_.a.rows()) = controller_.a * states + controller_.b * y;
    const VectorXd force =
        -commands_.directions.transpose() *
        ((controller_.c * states + controller_.d * y).array() / commands_.scale.array()).matrix();
    const VectorXd of_new =
        held_ > 1 ? VectorXd(x.segment(first_held + n * (held_ - 2), n)) : force;
    for (Index i = 0; i < count; ++i) {
      const LoopMode& m = modes_[i];
      next.segment<2>(2 * i) = m.transition * x.segment<2>(2 * i) + m.of_old * m.drive.dot(of_old) +
                               m.of_new * m.drive.dot(of_new);
    }
    next.segment(first_held, n) = force;
    next.segment(first_held + n, n * (held_ - 1)) = x.segment(first_held, n * (held_ - 1));
    return next;
  }

  ControllerStateSpace controller_;
  Range commands_;
  double fraction_ = 0.0;
  Index held_ = 1;
  std::vector<LoopMode> modes_;
};

/// Frequencies for the search of the largest sensitivity: a logarithmic grid, refined around the modes.
std::vector<double> test_frequencies(const std::vector<PlantMode>& modes, double highest) {
  constexpr int kPerDecade = 200;
  constexpr int kAroundMode = 20;
  std::vector<double> out;
  for (double f = 1e-5 * highest; f < highest; f *= std::pow(10.0, 1.0 / kPerDecade))
    out.push_back(f);
  for (const PlantMode& mode : modes)
    for (int i = -kAroundMode; i <= kAroundMode; ++i) {
      const double f = mode.natural_frequency_hz * (1.0 + 0.2 * mode.damping_ratio * i);
      if (f > 0.0 && f < highest) out.push_back(f);
    }
  return out;
}

}  // namespace

double largest_sensitivity(const MatrixXcd& loop_gain) {
  if (loop_gain.size() == 0) return 1.0;
  return 1.0 / (eigenvalues(loop_gain).array() + 1.0).abs().minCoeff();
}

bool LoopStability::stable() const noexcept {
  return !tested || largest_pole <= 1.0 + kEigenvalueRounding;
}

LoopStability loop_stability(const StageSpec& stage, const PlantSpec& plant) {
  const StageInfo& info = stage.info;
  const MotionController controller(stage.controller);
  LoopStability out;
  if (!controller.acts()) return out;
  const std::vector<PlantMode> modes = plant_modes(info, plant);
  const SampledLoop loop(info, modes, controller.realization());
  if (loop.states() > kMostStates) return out;
  const MatrixXd a = loop.matrix();
  if (!a.allFinite()) return out;
  const Eigen::VectorXcd poles = balanced_eigenvalues(a);
  if (!poles.allFinite()) return out;
  out.tested = true;
  Index outermost = 0;
  out.largest_pole = poles.cwiseAbs().maxCoeff(&outermost);
  out.pole_hz = std::abs(std::arg(poles[outermost])) / kTwoPi * info.sample_rate_hz;
  for (const double f : test_frequencies(modes, 0.5 * info.sample_rate_hz)) {
    const double size = largest_sensitivity(
        -sampled_response(modes, info.delay_s, info.sample_rate_hz, f) * controller.response(f));
    if (!(size > out.largest_sensitivity)) continue;
    out.largest_sensitivity = size;
    out.sensitivity_hz = f;
  }
  return out;
}

}  // namespace stageid
