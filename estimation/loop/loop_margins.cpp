#include "estimation/loop/loop_margins.hpp"

#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <functional>
#include <numbers>

#include "estimation/loop/response_gradient.hpp"
#include "estimation/uncertainty/dense_covariance.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;
constexpr double kTwoPi = 2.0 * std::numbers::pi;
constexpr double kDegrees = 180.0 / std::numbers::pi;
const double kDecibels = 20.0 / std::log(10.0);
constexpr double kStep = 1e-6;     // of differences, relative to the frequency
constexpr int kCrossingBits = 41;  // of its frequency
constexpr int kMinimumBits = 26;   // a minimum is flat: a closer one does not have another value

/// Frequencies at which a loop is searched: logarithmic, refined around the modes.
Eigen::VectorXd search_grid(const AdditiveModel& model) {
  constexpr int kPerDecade = 200;
  constexpr int kAroundMode = 20;
  const double highest = 0.5 * model.sample_rate_hz;
  std::vector<double> out;
  for (double f = 1e-5 * highest; f < highest; f *= std::pow(10.0, 1.0 / kPerDecade))
    out.push_back(f);
  for (const Submodel& s : model.submodels)
    for (int i = -kAroundMode; s.is_mode() && i <= kAroundMode; ++i) {
      const double f = s.natural_frequency_hz() * (1.0 + 0.2 * s.damping_ratio() * i);
      if (f > 0.0 && f < highest) out.push_back(f);
    }
  std::ranges::sort(out);
  return Eigen::Map<const Eigen::VectorXd>(out.data(), std::ssize(out));
}

/// The angle from -1 to L in (-pi, pi]: the lag, or if negative the lead, that turns L to -1.
double angle_to_critical(Complex L) { return std::arg(-L); }
/// The lag in (0, 2 pi] that turns L to -1.
double lag_to_critical(Complex L) {
  const double angle = angle_to_critical(L);
  return angle > 0.0 ? angle : angle + kTwoPi;
}

class MarginSearch {
 public:
  MarginSearch(const AdditiveModel& model, const LoopController& controller,
               const Eigen::MatrixXd& covariance)
      : model_(model),
        controller_(controller),
        covariance_(covariance),
        grid_hz_(search_grid(model)),
        points_(loop_points(model, controller, grid_hz_, false)) {}

  MarginSet margins() const {
    MarginSet out;
    for (Eigen::Index k = 0; k < controller_.actuators.cols(); ++k) out.loops.push_back(of_loop(k));
    const Eigen::Index determinant = controller_.actuators.cols();
    out.distance = least_size(determinant, 0.0);
    return out;
  }

 private:
  /// L_k, or the determinant for k = n_l.
  static Complex curve(const LoopPoint& point, Eigen::Index k) {
    return k < point.loop.size() ? point.loop[k] : point.determinant;
  }
  Complex curve_at(Eigen::Index k, double frequency_hz) const {
    return curve(
        loop_points(model_, controller_, Eigen::VectorXd::Constant(1, frequency_hz), false).front(),
        k);
  }

  /// Frequencies at which `of` L_k changes its sign.
  std::vector<double> crossings(Eigen::Index k, const std::function<double(Complex)>& of) const {
    std::vector<double> out;
    for (std::size_t i = 1; i < points_.size(); ++i) {
      const double before = of(curve(points_[i - 1], k));
      const double after = of(curve(points_[i], k));
      if (!(std::min(before, after) < 0.0 && std::max(before, after) >= 0.0)) continue;
      std::uintmax_t evaluations = 100;
      const auto [low, high] = boost::math::tools::toms748_solve(
          [&](double f) { return of(curve_at(k, f)); }, grid_hz_[i - 1], grid_hz_[i], before, after,
          boost::math::tools::eps_tolerance<double>(kCrossingBits), evaluations);
      out.push_back(0.5 * (low + high));
    }
    return out;
  }

  /// Not at an end of the frequencies, where a crossing stays.
  bool is_inside(double frequency_hz) const {
    return frequency_hz > 0.0 && frequency_hz * (1.0 + kStep) < 0.5 * model_.sample_rate_hz;
  }

  /// Error of the curve and its frequency at a crossing, by the parameters.
  struct Slope {
    Complex value;
    Complex by_omega;
    Eigen::VectorXcd by_parameters;  ///< empty without covariance
  };
  Slope slope(Eigen::Index k, double frequency_hz) const {
    Slope out;
    if (is_inside(frequency_hz))
      out.by_omega =
          (curve_at(k, frequency_hz * (1.0 + kStep)) - curve_at(k, frequency_hz * (1.0 - kStep))) /
          (2.0 * kStep * kTwoPi * frequency_hz);
    const Eigen::VectorXd at = Eigen::VectorXd::Constant(1, frequency_hz);
    const LoopPoint point = loop_points(model_, controller_, at, true).front();
    out.value = curve(point, k);
    if (covariance_.size() > 0)
      out.by_parameters =
          ResponseGradient(model_, covariance_.rows(), at).of(0, point.weights.col(k));
    return out;
  }

  /// The standard deviation of a linear function of the parameters.
  std::optional<double> deviation(const Eigen::VectorXd& gradient) const {
    if (gradient.size() == 0) return {};
    const double variance = gradient.dot(covariance_ * gradient);
    if (!std::isfinite(variance)) return {};
    return std::sqrt(std::max(variance, 0.0));
  }

  Margin margin(double value, double frequency_hz, const Eigen::VectorXd& gradient,
                const Eigen::VectorXd& omega_gradient = {}) const {
    const auto [low_hz, high_hz] = model_.fit.band_hz;
    const bool known = high_hz > low_hz;
    Margin out{value, frequency_hz, deviation(gradient), deviation(omega_gradient / kTwoPi),
               known && (frequency_hz < low_hz || frequency_hz > high_hz)};
    return out;
  }

  Margin gain_margin(Eigen::Index k, double frequency_hz) const {
    const Slope s = slope(k, frequency_hz);
    Eigen::VectorXd omega = Eigen::VectorXd::Zero(s.by_parameters.size());
    if (is_inside(frequency_hz)) omega = -s.by_parameters.imag() / s.by_omega.imag();
    const Eigen::VectorXd real = s.by_parameters.real() + s.by_omega.real() * omega;
    return margin(-kDecibels * std::log(std::abs(s.value)), frequency_hz,
                  kDecibels / s.value.real() * real, omega);
  }

  /// @param delay as the delay that turns L to -1, else as the angle
  Margin phase_margin(Eigen::Index k, double frequency_hz, bool delay) const {
    const Slope s = slope(k, frequency_hz);
    const Complex turn = s.by_omega / s.value;
    const Eigen::VectorXcd relative = s.by_parameters / s.value;
    const Eigen::VectorXd omega = -relative.real() / turn.real();
    const Eigen::VectorXd angle = relative.imag() + turn.imag() * omega;
    if (!delay)
      return margin(kDegrees * std::abs(angle_to_critical(s.value)), frequency_hz, kDegrees * angle,
                    omega);
    const double omega_rad_s = kTwoPi * frequency_hz;
    const double lag_s = lag_to_critical(s.value) / omega_rad_s;
    return margin(lag_s, frequency_hz, (angle - lag_s * omega) / omega_rad_s, omega);
  }

  /// The least |curve + offset|. At a minimum, a change of its frequency has no effect.
  Margin least_size(Eigen::Index k, double offset) const {
    Eigen::Index least = 0;
    Eigen::VectorXd size(grid_hz_.size());
    for (Eigen::Index i = 0; i < size.size(); ++i)
      size[i] = std::abs(curve(points_[i], k) + offset);
    size.minCoeff(&least);
    const double frequency_hz =
        boost::math::tools::brent_find_minima(
            [&](double f) { return std::abs(curve_at(k, f) + offset); },
            grid_hz_[std::max<Eigen::Index>(least - 1, 0)],
            grid_hz_[std::min(least + 1, grid_hz_.size() - 1)], kMinimumBits)
            .first;
    const Slope s = slope(k, frequency_hz);
    const Complex at = s.value + offset;
    return margin(std::abs(at), frequency_hz,
                  (std::conj(at) * s.by_parameters).real() / std::abs(at));
  }

  /// Where L_k crosses the real axis. At 0 and at half the sample rate it is real, and crosses to negative frequencies,
  /// unless it is infinite.
  std::vector<double> real_axis_crossings(Eigen::Index k) const {
    std::vector<double> out = crossings(k, [](Complex L) { return L.imag(); });
    for (const double f : {0.0, 0.5 * model_.sample_rate_hz})
      if (std::isfinite(std::abs(curve_at(k, f)))) out.push_back(f);
    return out;
  }

  /// The least value, and where it is.
  struct Least {
    double value = HUGE_VAL;
    double frequency_hz = 0.0;

    bool found() const { return value < HUGE_VAL; }
    void take(double other, double other_hz) {
      if (other < value) *this = {other, other_hz};
    }
  };

  LoopMargins of_loop(Eigen::Index k) const {
    LoopMargins out;
    Least rise;
    Least fall;
    for (const double f : real_axis_crossings(k)) {
      const double real = -curve_at(k, f).real();
      if (real > 0.0 && real < 1.0) rise.take(-real, f);
      if (real > 1.0) fall.take(real, f);
    }
    if (rise.found()) out.gain_db = gain_margin(k, rise.frequency_hz);
    if (fall.found()) {
      out.gain_reduction_db = gain_margin(k, fall.frequency_hz);
      out.gain_reduction_db->value *= -1.0;
    }
    Least angle;
    Least lag_s;
    for (const double f : crossings(k, [](Complex L) { return std::norm(L) - 1.0; })) {
      const Complex L = curve_at(k, f);
      angle.take(std::abs(angle_to_critical(L)), f);
      lag_s.take(lag_to_critical(L) / (kTwoPi * f), f);
    }
    if (angle.found()) out.phase_deg = phase_margin(k, angle.frequency_hz, false);
    if (lag_s.found()) out.delay_s = phase_margin(k, lag_s.frequency_hz, true);
    out.modulus = least_size(k, 1.0);
    return out;
  }

  const AdditiveModel& model_;
  const LoopController& controller_;
  const Eigen::MatrixXd& covariance_;
  Eigen::VectorXd grid_hz_;
  std::vector<LoopPoint> points_;
};

}  // namespace

std::optional<double> Margin::radius_95() const {
  // The quantile of a real Gaussian.
  static const double quantile = error_quantile_95(1.0);
  return deviation ? std::optional(quantile * *deviation) : std::nullopt;
}

MarginSet loop_margins(const AdditiveModel& model, const LoopController& controller,
                       const Eigen::MatrixXd& covariance) {
  return MarginSearch(model, controller, covariance).margins();
}

}  // namespace stageid
