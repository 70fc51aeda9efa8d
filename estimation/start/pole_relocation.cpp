#include "estimation/start/pole_relocation.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>

#include "estimation/equations/sigma_equations.hpp"
#include "estimation/model/pole_set.hpp"
#include "estimation/problem/fit_problem.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

constexpr int kIterations = 20;
constexpr double kSettled = 1e-3;         // movement of every pole in its own half-power widths
constexpr double kSettledExactly = 1e-9;  // without noise
constexpr double kStartDamping = 0.01;
constexpr double kLeastDamping = 1e-5;
constexpr double kLinesWide = 3.0;   // minimum half-power width of a pole, but see narrowest()
constexpr double kExact = 2e-11;     // relative residual that is only rounding
constexpr double kAccurate = 1e-4;   // relative residual below which sums are too inaccurate
constexpr double kNoiseless = 1e-8;  // relative residual that is no measurement's noise

Eigen::VectorXcd complex(const SplitMatrix& column) {
  return column.re.cast<Complex>() + Complex(0.0, 1.0) * column.im.cast<Complex>();
}

class Relocation {
 public:
  Relocation(const FrfEstimate& frf, const AdditiveModel& model, const Eigen::MatrixXd& weights,
             const Workers& workers)
      : exact_(model.hold == HoldModel::exact),
        lines_{frf.omega_rad_s(), frf.sample_rate_hz > 0.0 ? 1.0 / frf.sample_rate_hz : 0.0,
               model.hold} {
    const HoldEquivalent through(lines_, model.mean_delay_s());
    const Eigen::VectorXcd x = complex(through.x());
    // Remove delay and hold from the data: the rest is rational in x.
    const Eigen::VectorXcd factor = complex(through.first());
    signal_ = weighted_power(frf, weights);
    for (const Submodel& s : model.submodels) {
      integrators_ = std::max(integrators_, s.integrators);
      constant_ = constant_ || (s.integrators == 0 && s.denominator.size() == 1);
    }
    constant_ = constant_ || exact_;  // a held input adds a constant
    equations_.emplace(x, exact_, frf.response, factor, weights, beside(x), workers);
  }

  std::vector<ModeCandidate> run(std::size_t modes) {
    spread(modes);
    for (int i = 0; i < kIterations; ++i)
      if (const double moved = relocate(); !(moved > (noiseless_ ? kSettledExactly : kSettled)))
        break;
    return modes_of_poles();
  }

 private:
  /// Places the poles where the response changes: between any two there is an equal share of the path.
  void spread(std::size_t modes) {
    const Eigen::VectorXd& path = equations_->path();
    const Eigen::VectorXd& omega = lines_.omega_rad_s;
    Eigen::Index k = 0;
    for (std::size_t i = 0; i < modes; ++i) {
      const double wanted = (static_cast<double>(i) + 0.5) / static_cast<double>(modes);
      while (k + 2 < omega.size() && path[k + 1] < wanted) ++k;
      const double part =
          std::clamp((wanted - path[k]) / std::max(path[k + 1] - path[k], 1e-300), 0.0, 1.0);
      const double w = omega[k] + part * (omega[k + 1] - omega[k]);
      poles_.pairs.push_back(to_x(Complex(-kStartDamping, 1.0) * w));
    }
  }

  Complex to_x(Complex s) const { return exact_ ? std::exp(s * lines_.sample_period_s) : s; }
  Complex to_s(Complex x) const { return exact_ ? std::log(x) / lines_.sample_period_s : x; }

  /// The functions of the numerators besides the poles.
  SplitMatrix beside(const Eigen::VectorXcd& x) const {
    const Eigen::Index count = integrators_ + (constant_ ? 1 : 0);
    SplitMatrix out{Eigen::MatrixXd(x.size(), count), Eigen::MatrixXd(x.size(), count)};
    for (int l = 1; l <= integrators_; ++l) {
      const Eigen::ArrayXcd inverse = (x.array() - (exact_ ? 1.0 : 0.0)).inverse();
      const Eigen::ArrayXcd column = l == 1 ? inverse : Eigen::ArrayXcd(inverse.square());
      out.re.col(l - 1) = column.real();
      out.im.col(l - 1) = column.imag();
    }
    if (constant_) out.re.rightCols(1).setOnes();
    if (constant_) out.im.rightCols(1).setZero();
    return out;
  }

  /// One iteration. @returns the largest movement of a pole, in half-power widths.
  double relocate() {
    Eigen::MatrixXd R = equations_->triangle(poles_, accurate_);
    const Eigen::Index n = poles_.size();
    if (R.col(n).squaredNorm() < kExact * kExact * signal_) return 0.0;

    // Relaxed: the mean of Re sigma over the lines is 1, so sigma cannot vanish.
    Eigen::VectorXd mean(n + 1);
    mean << partial_fractions(poles_, equations_->x()).re.colwise().mean().transpose(), 1.0;
    const Eigen::VectorXd scale = R.colwise().norm().cwiseMax(1e-300).cwiseInverse();
    R *= scale.asDiagonal();
    for (Eigen::Index i = 0; i <= n; ++i)
      if (std::abs(R(i, i)) < 1e-15) R(i, i) = 1e-15;
    Eigen::VectorXd sigma = scale.cwiseProduct(mean);
    R.triangularView<Eigen::Upper>().transpose().solveInPlace(sigma);
    const double squares = 1.0 / sigma.squaredNorm();  // of the residual, with mean sigma = 1
    R.triangularView<Eigen::Upper>().solveInPlace(sigma);
    sigma = scale.cwiseProduct(sigma);
    const double d = sigma[n];
    if (!sigma.allFinite() || d == 0.0) return 0.0;
    noiseless_ = accurate_ && squares < kNoiseless * kNoiseless * signal_;
    accurate_ = squares < kAccurate * kAccurate * signal_;
    return move(zeros_of_sum(poles_, sigma.head(n) / d));
  }

  /// The minimum damping ratio at a frequency, limited to that of the start. A sharper pole would be determined by the
  /// noise of one line, unless there is none. Modes may be sharper; the fit that follows finds their damping.
  double narrowest(double omega_rad_s) const {
    if (noiseless_) return kLeastDamping;
    const Eigen::VectorXd& omega = lines_.omega_rad_s;
    const Eigen::Index last = omega.size() - 1;
    const double* above = std::lower_bound(omega.data(), omega.data() + last, omega_rad_s);
    const Eigen::Index k = std::clamp<Eigen::Index>(above - omega.data(), 1, last);
    const double spacing = omega[k] - omega[k - 1];
    return std::clamp(0.5 * kLinesWide * spacing / omega_rad_s, kLeastDamping, kStartDamping);
  }

  /// Accepts stable zeros and reflects unstable ones.
  double move(const Eigen::VectorXcd& zeros) {
    const double highest = 10.0 * lines_.omega_rad_s.maxCoeff();
    PoleSet found;
    for (const Complex zero : zeros) {
      if (!(std::abs(zero) > 0.0) || (exact_ && zero.imag() == 0.0 && zero.real() < 0.0)) continue;
      Complex s = to_s(zero);
      const double size = std::min(std::abs(s), highest);
      if (s.imag() < 0.0) continue;  // the conjugate of another
      s *= size / std::abs(s);
      s = {-std::max(std::abs(s.real()), narrowest(size) * size), s.imag()};
      if (s.imag() == 0.0)
        found.reals.push_back(to_x(s).real());
      else
        found.pairs.push_back(to_x(s));
    }
    std::ranges::sort(found.pairs,
                      [&](Complex a, Complex b) { return to_s(a).imag() < to_s(b).imag(); });
    std::ranges::sort(found.reals);
    double largest = found.pairs.size() == poles_.pairs.size() ? 0.0 : 1.0;
    for (std::size_t i = 0; i < std::min(found.pairs.size(), poles_.pairs.size()); ++i) {
      const Complex s = to_s(found.pairs[i]);
      largest = std::max(largest, std::abs(s - to_s(poles_.pairs[i])) / (-2.0 * s.real()));
    }
    poles_ = std::move(found);
    return poles_.size() == 0 ? 0.0 : largest;
  }

  /// Two real poles form an overdamped mode; of an odd number, the fastest is discarded.
  std::vector<ModeCandidate> modes_of_poles() const {
    std::vector<ModeCandidate> modes;
    const auto add = [&](double omega_rad_s, double damping_ratio) {
      modes.push_back({omega_rad_s / (2.0 * std::numbers::pi), damping_ratio, 1});
    };
    for (const Complex pair : poles_.pairs) {
      const Complex s = to_s(pair);
      add(std::abs(s), -s.real() / std::abs(s));
    }
    std::vector<double> decays;
    for (const double real : poles_.reals) decays.push_back(-to_s(real).real());
    std::ranges::sort(decays);
    for (std::size_t i = 0; i + 1 < decays.size(); i += 2) {
      const double omega = std::sqrt(decays[i] * decays[i + 1]);
      add(omega, 0.5 * (decays[i] + decays[i + 1]) / omega);
    }
    std::ranges::sort(modes, {}, &ModeCandidate::frequency_hz);
    return modes;
  }

  bool exact_;
  ModelLines lines_;
  int integrators_ = 0;
  bool constant_ = false;
  bool accurate_ = false;
  bool noiseless_ = false;
  double signal_ = 0.0;  // sum w |G|^2
  std::optional<SigmaEquations> equations_;
  PoleSet poles_;  // x
};

}  // namespace

std::vector<ModeCandidate> relocate_poles(const FrfEstimate& frf, const AdditiveModel& model,
                                          const Eigen::MatrixXd& weights, std::size_t modes,
                                          const Workers& workers) {
  if (modes == 0 || frf.lines() < 2) return {};
  return Relocation(frf, model, weights, workers).run(modes);
}

}  // namespace stageid
