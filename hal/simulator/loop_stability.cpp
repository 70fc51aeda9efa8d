#include "hal/simulator/loop_stability.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "hal/simulator/modal_propagator.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Far above the rounding errors of eigenvalues of a balanced matrix of some hundred rows.
constexpr double kRounding = 1e-8;
/// Limits the computation to some seconds.
constexpr Index kMostStates = 1000;

/// A mode in coordinates of the closed axes; state [q, q' / omega_scale].
struct LoopMode {
  VectorXd drive;  // axes
  VectorXd seen;   // axes
  Eigen::Matrix2d transition;
  Eigen::Vector2d of_old, of_new;
};

/// The linear map from one sample of the unexcited loop to the next.
class SampledLoop {
 public:
  SampledLoop(const WaferStageSpec& spec, const AxisLoop& axes) : axes_(axes) {
    const double period_s = 1.0 / spec.info.sample_rate_hz;
    const double whole = std::floor(spec.delay_s / period_s);
    fraction_ = spec.delay_s / period_s - whole;
    held_ = static_cast<Index>(whole) + 1;
    add_modes(wafer_stage_modes(spec), period_s);
    for (const std::vector<BiquadSection>& list : axes.sections())
      sections_ += static_cast<Index>(list.size());
  }

  Index states() const {
    return 2 * static_cast<Index>(modes_.size()) + held_ * axes_.axes() + 2 * sections_;
  }

  MatrixXd matrix() const {
    MatrixXd a(states(), states());
    for (Index i = 0; i < states(); ++i) a.col(i) = step(VectorXd::Unit(states(), i));
    return a;
  }

 private:
  void add_modes(const std::vector<PlantMode>& modes, double period_s) {
    double strongest = 0.0;
    for (const PlantMode& mode : modes) {
      LoopMode m;
      m.drive = axes_.actuator_decoupling().transpose() * mode.actuator_shape;
      m.seen = axes_.sensor_decoupling() * mode.sensor_shape;
      const double omega = kTwoPi * mode.natural_frequency_hz;
      const auto over = [&](double part) {
        return modal_propagator(omega, mode.damping_ratio, part * period_s);
      };
      m.transition = over(1.0).transition;
      m.of_old = over(1.0 - fraction_).transition * over(fraction_).input;
      m.of_new = over(1.0 - fraction_).input;
      strongest = std::max(strongest, m.drive.norm() * m.seen.norm());
      modes_.push_back(std::move(m));
    }
    std::erase_if(modes_, [&](const LoopMode& m) {
      return m.drive.norm() * m.seen.norm() <= 1e-12 * strongest;
    });
  }

  VectorXd step(const VectorXd& x) const {
    VectorXd next(x.size());
    const Index n = axes_.axes();
    const Index count = static_cast<Index>(modes_.size());
    const Index first_held = 2 * count;
    VectorXd position = VectorXd::Zero(n);
    for (Index i = 0; i < count; ++i)
      position += modes_[static_cast<std::size_t>(i)].seen * x[2 * i];
    const VectorXd force = -control(position, x, next);
    // Held commands, newest first: u[n-1] ... u[n-d-1].
    const VectorXd of_old = x.segment(first_held + n * (held_ - 1), n);
    const VectorXd of_new =
        held_ > 1 ? VectorXd(x.segment(first_held + n * (held_ - 2), n)) : force;
    for (Index i = 0; i < count; ++i) {
      const LoopMode& m = modes_[static_cast<std::size_t>(i)];
      next.segment<2>(2 * i) = m.transition * x.segment<2>(2 * i) + m.of_old * m.drive.dot(of_old) +
                               m.of_new * m.drive.dot(of_new);
    }
    next.segment(first_held, n) = force;
    next.segment(first_held + n, n * (held_ - 1)) = x.segment(first_held, n * (held_ - 1));
    return next;
  }

  /// Direct form II transposed, as in MotionController.
  VectorXd control(VectorXd signal, const VectorXd& x, VectorXd& next) const {
    Index at = states() - 2 * sections_;
    for (Index axis = 0; axis < axes_.axes(); ++axis)
      for (const BiquadSection& s : axes_.sections()[static_cast<std::size_t>(axis)]) {
        const double in = signal[axis];
        const double out = s.b0 * in + x[at];
        next[at] = s.b1 * in - s.a1 * out + x[at + 1];
        next[at + 1] = s.b2 * in - s.a2 * out;
        signal[axis] = out;
        at += 2;
      }
    return signal;
  }

  const AxisLoop& axes_;
  double fraction_ = 0.0;
  Index held_ = 1;
  Index sections_ = 0;
  std::vector<LoopMode> modes_;
};

/// Scales states by powers of two until rows and columns have similar norms (Parlett and Reinsch 1969). With
/// metres and newtons, the eigenvalues would lose half their digits.
void balance(MatrixXd& a) {
  for (bool changed = true; changed;) {
    changed = false;
    for (Index i = 0; i < a.rows(); ++i) {
      const double diagonal = std::abs(a(i, i));
      const double column = a.col(i).lpNorm<1>() - diagonal;
      const double row = a.row(i).lpNorm<1>() - diagonal;
      if (!(column > 0.0) || !(row > 0.0)) continue;
      const double factor = std::exp2(std::round(0.5 * std::log2(row / column)));
      if (!(column * factor + row / factor < 0.95 * (column + row))) continue;
      a.col(i) *= factor;
      a.row(i) /= factor;
      changed = true;
    }
  }
}

/// Frequencies for the search of the largest sensitivity: a logarithmic grid, refined around the modes.
std::vector<double> test_frequencies(const WaferStageSpec& spec) {
  constexpr int kPerDecade = 200;
  constexpr int kAroundMode = 20;
  const double highest = 0.5 * spec.info.sample_rate_hz;
  std::vector<double> out;
  for (double f = 1e-5 * highest; f < highest; f *= std::pow(10.0, 1.0 / kPerDecade))
    out.push_back(f);
  for (const PlantMode& mode : wafer_stage_modes(spec))
    for (int i = -kAroundMode; i <= kAroundMode; ++i) {
      const double f = mode.natural_frequency_hz * (1.0 + 0.2 * mode.damping_ratio * i);
      if (f > 0.0 && f < highest) out.push_back(f);
    }
  return out;
}

}  // namespace

AxisLoop::AxisLoop(const MotionControllerSpec& spec) : sample_rate_hz_(spec.sample_rate_hz) {
  std::vector<Index> closed;
  for (std::size_t i = 0; i < spec.axes.size(); ++i) {
    if (spec.axes[i].crossover_hz == 0.0 || spec.axes[i].gain == 0.0) continue;
    closed.push_back(static_cast<Index>(i));
    sections_.push_back(controller_sections(spec.axes[i], spec.sample_rate_hz));
  }
  sensor_decoupling_ = spec.sensor_decoupling(closed, Eigen::all);
  actuator_decoupling_ = spec.actuator_decoupling(Eigen::all, closed);
}

MatrixXcd AxisLoop::plant_of_axes(const MatrixXcd& plant) const {
  return sensor_decoupling_ * plant * actuator_decoupling_;
}

Eigen::VectorXcd AxisLoop::controllers(double frequency_hz) const {
  const std::complex<double> z_inverse = std::polar(1.0, -kTwoPi * frequency_hz / sample_rate_hz_);
  Eigen::VectorXcd out = Eigen::VectorXcd::Ones(axes());
  for (Index axis = 0; axis < axes(); ++axis)
    for (const BiquadSection& s : sections_[static_cast<std::size_t>(axis)])
      out[axis] *= s.response(z_inverse);
  return out;
}

MatrixXcd AxisLoop::gain(const MatrixXcd& plant, double frequency_hz) const {
  return plant_of_axes(plant) * controllers(frequency_hz).asDiagonal();
}

double largest_sensitivity(const MatrixXcd& loop_gain) {
  if (loop_gain.size() == 0) return 1.0;
  const Eigen::ComplexEigenSolver<MatrixXcd> loci(loop_gain, false);
  return 1.0 / (loci.eigenvalues().array() + 1.0).abs().minCoeff();
}

bool LoopStability::stable() const noexcept { return !tested || largest_pole <= 1.0 + kRounding; }

LoopStability loop_stability(const WaferStageSpec& spec) {
  const AxisLoop axes(spec.controller);
  LoopStability out;
  if (axes.axes() == 0) return out;
  const SampledLoop loop(spec, axes);
  if (loop.states() > kMostStates) return out;
  MatrixXd a = loop.matrix();
  balance(a);
  const Eigen::EigenSolver<MatrixXd> solver(a, false);
  if (!a.allFinite() || solver.info() != Eigen::Success) return out;
  out.tested = true;
  Index outermost = 0;
  out.largest_pole = solver.eigenvalues().cwiseAbs().maxCoeff(&outermost);
  out.pole_hz =
      std::abs(std::arg(solver.eigenvalues()[outermost])) / kTwoPi * spec.info.sample_rate_hz;
  const std::vector<PlantMode> modes = wafer_stage_modes(spec);
  for (const double f : test_frequencies(spec)) {
    const double size = largest_sensitivity(
        axes.gain(sampled_response(modes, spec.delay_s, spec.info.sample_rate_hz, f), f));
    if (!(size > out.largest_sensitivity)) continue;
    out.largest_sensitivity = size;
    out.sensitivity_hz = f;
  }
  return out;
}

}  // namespace stageid
