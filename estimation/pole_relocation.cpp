#include "estimation/pole_relocation.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "estimation/fit_problem.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

constexpr int kIterations = 8;
constexpr int kShares = 8;
constexpr double kSettled = 1e-3;  // move of every pole in its own half-power widths
constexpr double kLeastDamping = 0.01;
constexpr double kRegularization = 1e-13;

Eigen::VectorXcd complex(const SplitMatrix& column) {
  return column.re.cast<Complex>() + Complex(0.0, 1.0) * column.im.cast<Complex>();
}

double mean_delay_s(const AdditiveModel& model) {
  if (model.input_delay_s.size() == 0) return 0.0;
  return model.input_delay_s.mean() + model.output_delay_s.mean();
}

class Relocation {
 public:
  Relocation(const FrfEstimate& frf, const AdditiveModel& model, const Eigen::MatrixXd& weights,
             int threads)
      : weights_(weights),
        threads_(threads),
        exact_(model.hold == HoldModel::exact),
        lines_{frf.omega_rad_s(), frf.sample_rate_hz > 0.0 ? 1.0 / frf.sample_rate_hz : 0.0,
               model.hold} {
    const LineOperator through(lines_, mean_delay_s(model));
    x_ = complex(through.x());
    // Delay and hold out of the data: the rest is rational in x.
    const Eigen::VectorXcd factor = complex(through.first());
    H_ = frf.response * factor.cwiseInverse().asDiagonal();
    size_ = factor.cwiseAbs();
    for (const Submodel& s : model.submodels) {
      integrators_ = std::max(integrators_, s.integrators);
      constant_ = constant_ || (s.integrators == 0 && s.denominator.size() == 1);
    }
    constant_ = constant_ || exact_;  // a held input leaves one
  }

  std::vector<ModeCandidate> run(std::size_t modes) {
    spread(modes);
    for (int i = 0; i < kIterations; ++i)
      if (!(relocate() > kSettled)) break;
    std::vector<ModeCandidate> out;
    for (const Complex s : poles_)
      out.push_back({std::abs(s) / (2.0 * std::numbers::pi), -s.real() / std::abs(s), 1});
    return out;
  }

 private:
  /// As many lines between any two poles, each as wide as its distance to the next.
  void spread(std::size_t modes) {
    const Eigen::VectorXd& omega = lines_.omega_rad_s;
    const auto last = static_cast<double>(omega.size() - 1);
    const auto at = [&](double line) {
      const double k = std::clamp(line, 0.0, last);
      const auto low = static_cast<Eigen::Index>(std::min(std::floor(k), last - 1.0));
      return omega[low] + (k - static_cast<double>(low)) * (omega[low + 1] - omega[low]);
    };
    const double step = last / static_cast<double>(modes);
    for (std::size_t i = 0; i < modes; ++i) {
      const double middle = (static_cast<double>(i) + 0.5) * step;
      const double width = at(middle + 0.5 * step) - at(middle - 0.5 * step);
      const double w = at(middle);
      const double zeta = std::max(kLeastDamping, 0.5 * width / w);
      poles_.emplace_back(-std::min(zeta, 0.5) * w, w);
    }
  }

  Complex to_x(Complex s) const { return exact_ ? std::exp(s * lines_.sample_period_s) : s; }
  Complex to_s(Complex x) const { return exact_ ? std::log(x) / lines_.sample_period_s : x; }

  /// Partial fractions of real coefficients: 1/(x-p) + 1/(x-p*) and j/(x-p) - j/(x-p*).
  SplitMatrix fractions() const {
    const Eigen::Index N = x_.size();
    const auto pairs = static_cast<Eigen::Index>(poles_.size());
    SplitMatrix phi{Eigen::MatrixXd(N, 2 * pairs), Eigen::MatrixXd(N, 2 * pairs)};
    for (Eigen::Index i = 0; i < pairs; ++i) {
      const Complex p = to_x(poles_[static_cast<std::size_t>(i)]);
      for (Eigen::Index k = 0; k < N; ++k) {
        const Complex a = 1.0 / (x_[k] - p);
        const Complex b = 1.0 / (x_[k] - std::conj(p));
        const Complex sum = a + b;
        const Complex difference = Complex(0.0, 1.0) * (a - b);
        phi.re(k, 2 * i) = sum.real();
        phi.im(k, 2 * i) = sum.imag();
        phi.re(k, 2 * i + 1) = difference.real();
        phi.im(k, 2 * i + 1) = difference.imag();
      }
    }
    return phi;
  }

  /// What the numerators have beside the poles.
  SplitMatrix beside() const {
    const Eigen::Index count = integrators_ + (constant_ ? 1 : 0);
    SplitMatrix out{Eigen::MatrixXd(x_.size(), count), Eigen::MatrixXd(x_.size(), count)};
    for (int l = 1; l <= integrators_; ++l) {
      const Eigen::ArrayXcd inverse = (x_.array() - (exact_ ? 1.0 : 0.0)).inverse();
      const Eigen::ArrayXcd column = l == 1 ? inverse : Eigen::ArrayXcd(inverse.square());
      out.re.col(l - 1) = column.real();
      out.im.col(l - 1) = column.imag();
    }
    if (constant_) out.re.rightCols(1).setOnes();
    if (constant_) out.im.rightCols(1).setZero();
    return out;
  }

  /// One iteration. @returns the largest move of a pole, in half-power widths.
  double relocate() {
    const SplitMatrix phi = fractions();
    const SplitMatrix own = beside();
    const Eigen::Index n = phi.re.cols();
    const Eigen::Index n_r = n + own.re.cols();
    SplitMatrix basis{Eigen::MatrixXd(x_.size(), n_r), Eigen::MatrixXd(x_.size(), n_r)};
    basis.re << phi.re, own.re;
    basis.im << phi.im, own.im;

    // The normal equations of sigma's coefficients (c, d), the channels' own eliminated.
    // A fixed number of shares: the sum does not depend on the threads.
    std::vector<Eigen::MatrixXd> shares(kShares, Eigen::MatrixXd::Zero(n + 1, n + 1));
    parallel_tasks(kShares, threads_, [&](int share) {
      for (Eigen::Index c = share; c < H_.rows(); c += kShares)
        shares[static_cast<std::size_t>(share)] += eliminated(c, phi, basis);
    });
    Eigen::MatrixXd S = Eigen::MatrixXd::Zero(n + 1, n + 1);
    for (const Eigen::MatrixXd& share : shares) S += share;

    // Relaxed: the mean of Re sigma over the lines is 1, so that sigma cannot vanish.
    Eigen::VectorXd mean(n + 1);
    mean << phi.re.colwise().mean().transpose(), 1.0;
    Eigen::VectorXd scale = S.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd scaled = scale.asDiagonal() * S * scale.asDiagonal();
    scaled.diagonal().array() += kRegularization;
    const Eigen::VectorXd direction =
        scale.asDiagonal() * scaled.ldlt().solve(scale.cwiseProduct(mean));
    const double d = direction[n];
    if (!direction.allFinite() || d == 0.0) return 0.0;
    return move(zeros(direction.head(n) / d));
  }

  /// Schur complement of a channel's numerators in the weighted normal matrix of
  /// [basis | -H phi, -H].
  Eigen::MatrixXd eliminated(Eigen::Index c, const SplitMatrix& phi,
                             const SplitMatrix& basis) const {
    const Eigen::Index N = x_.size();
    const Eigen::Index n_r = basis.re.cols();
    const Eigen::Index n_s = phi.re.cols() + 1;
    const Eigen::ArrayXd w = weights_.row(c).transpose().cwiseSqrt().array() * size_.array();
    Eigen::MatrixXd A(2 * N, n_r + n_s);
    A.topLeftCorner(N, n_r) = basis.re.array().colwise() * w;
    A.bottomLeftCorner(N, n_r) = basis.im.array().colwise() * w;
    const Eigen::ArrayXcd H = H_.row(c).transpose().array();
    const Eigen::ArrayXd h_re = -w * H.real();
    const Eigen::ArrayXd h_im = -w * H.imag();
    A.block(0, n_r, N, n_s - 1) =
        (phi.re.array().colwise() * h_re - phi.im.array().colwise() * h_im).matrix();
    A.block(N, n_r, N, n_s - 1) =
        (phi.re.array().colwise() * h_im + phi.im.array().colwise() * h_re).matrix();
    A.rightCols(1) << h_re.matrix(), h_im.matrix();
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n_r + n_s, n_r + n_s);
    M.selfadjointView<Eigen::Lower>().rankUpdate(A.transpose());
    const Eigen::VectorXd scale =
        M.diagonal().head(n_r).cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd own = scale.asDiagonal() * M.topLeftCorner(n_r, n_r) * scale.asDiagonal();
    own.diagonal().array() += kRegularization;
    const Eigen::LLT<Eigen::MatrixXd> factor(own);
    const Eigen::MatrixXd border = M.bottomLeftCorner(n_s, n_r) * scale.asDiagonal();
    Eigen::MatrixXd S = M.bottomRightCorner(n_s, n_s).selfadjointView<Eigen::Lower>();
    if (factor.info() == Eigen::Success) {
      const Eigen::MatrixXd half = factor.matrixL().solve(border.transpose());
      S.noalias() -= half.transpose() * half;
    }
    return S;
  }

  /// Zeros of 1 + sum c_i phi_i: eigenvalues of the poles' real block matrix minus b c^T.
  Eigen::VectorXcd zeros(const Eigen::VectorXd& c) const {
    const Eigen::Index n = c.size();
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index i = 0; i < n / 2; ++i) {
      const Complex p = to_x(poles_[static_cast<std::size_t>(i)]);
      A.block<2, 2>(2 * i, 2 * i) << p.real(), p.imag(), -p.imag(), p.real();
      A.row(2 * i) -= 2.0 * c.transpose();  // b = (2, 0)
    }
    return A.eigenvalues();
  }

  /// Takes the upper half plane's, stable ones as they are and unstable ones reflected.
  double move(const Eigen::VectorXcd& x) {
    const double highest = lines_.omega_rad_s.maxCoeff();
    std::vector<Complex> found;
    for (const Complex value : x) {
      if (!(std::abs(value) > 0.0)) continue;
      Complex s = to_s(value);
      if (!(s.imag() > 1e-3 * std::abs(s))) continue;  // real, or the other of the pair
      if (s.real() > 0.0) s = {-s.real(), s.imag()};
      if (std::abs(s) > 10.0 * highest) continue;
      if (s.real() > -1e-5 * std::abs(s)) s = {-1e-5 * std::abs(s), s.imag()};
      found.push_back(s);
    }
    std::sort(found.begin(), found.end(), [](Complex a, Complex b) { return a.imag() < b.imag(); });
    double largest = found.size() == poles_.size() ? 0.0 : 1.0;
    for (std::size_t i = 0; i < std::min(found.size(), poles_.size()); ++i)
      largest = std::max(largest, std::abs(found[i] - poles_[i]) / (-2.0 * found[i].real()));
    poles_ = std::move(found);
    return poles_.empty() ? 0.0 : largest;
  }

  const Eigen::MatrixXd& weights_;
  int threads_;
  bool exact_;
  ModelLines lines_;
  int integrators_ = 0;
  bool constant_ = false;
  Eigen::VectorXcd x_;
  Eigen::MatrixXcd H_;          // n_c x N
  Eigen::VectorXd size_;        // |G| / |H| on every line
  std::vector<Complex> poles_;  // s, upper half plane
};

}  // namespace

std::vector<ModeCandidate> relocate_poles(const FrfEstimate& frf, const AdditiveModel& model,
                                          const Eigen::MatrixXd& weights, std::size_t modes,
                                          int threads) {
  if (modes == 0 || frf.lines() < 2) return {};
  return Relocation(frf, model, weights, threads).run(modes);
}

}  // namespace stageid
